# SPDX-License-Identifier: Apache-2.0
"""Pictures and clips of moving hair, on machines without a display."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from neuralocks_core import shading
from neuralocks_core.canvas import Camera, open_canvas
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import atomic_write
from neuralocks_core.mesh import vertex_normals

SUFFIXES = (".png", ".mp4", ".gif")


@dataclass(frozen=True)
class Detail:
    """How finely hair is drawn.

    Attributes:
        strands: of a larger groom only so many, of a smaller one copies beside its own.
        vertices: of each.
        scale: how many times larger to draw before reducing.
        width: of a strand, in pixels of the larger drawing.
        samples: of a pixel of the larger drawing; 0 for one, without the cost of counting.
    """

    strands: int
    vertices: int
    scale: float
    width: float
    samples: int


PICTURE = Detail(16000, 24, 2.0, 1.2, 4)
CLIP = Detail(4000, 16, 1.5, 2.0, 0)
"""A quarter of the strands, wider: in motion it looks the same, and a frame takes a fifth of the time."""


@dataclass(frozen=True)
class Scene:
    """What is to be seen, from arrays.

    Attributes:
        times: of the frames (T,) [s].
        head: rigid transforms bind world -> posed world of the head (T, 4, 4).
        facing: rotation (3, 3) whose transpose's third column is where the face looks in bind pose.
        centre: middle of the head in bind pose (3,) [m].
        counts: vertices of each strand (S,); none where all hair is mesh hair.
        rest: points of strands, or of mesh hair, in bind pose (P, 3) [m].
        hair: frame number -> strand points (P, 3) [m], world.
        triangles: of the body (F, 3), or None.
        body: frame number -> body points (V, 3) [m], world, or None.
        body_rest: body points in bind pose (V, 3) [m], or None.
        mesh_hair: vertices of the body that are hair (V,) bool, or None.
        look: colours.
    """

    times: np.ndarray
    head: np.ndarray
    facing: np.ndarray
    centre: np.ndarray
    counts: np.ndarray
    rest: np.ndarray
    hair: Callable[[int], np.ndarray]
    triangles: np.ndarray | None = None
    body: Callable[[int], np.ndarray] | None = None
    body_rest: np.ndarray | None = None
    mesh_hair: np.ndarray | None = None
    look: shading.Look = field(default_factory=shading.Look)


def render(
    scene: Scene,
    path: str | os.PathLike,
    *,
    size: tuple[int, int] | None = None,
    panels: int = 6,
    rate: float = 24.0,
    detail: Detail | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Path:
    """Write a strip of pictures (.png) or a clip (.mp4, .gif).

    Args:
        scene: what is to be seen.
        path: the file to write; its ending chooses the kind.
        size: width and height of one picture in pixels.
        panels: pictures in a strip, evenly over the time.
        rate: frames a second of a clip; in real time.
        detail: how finely; PICTURE or CLIP if left out.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: the ending is unknown, a library is missing, or the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in SUFFIXES:
        raise NeuralocksError(f"{path}: unknown kind of picture; end it in {', '.join(SUFFIXES)}")
    kind = path.suffix.lower()
    for module in ("PIL", "imageio", "imageio_ffmpeg")[: 3 if kind == ".mp4" else 1]:
        _need(module)
    still = kind == ".png"
    if still:
        frames = np.unique(np.linspace(0, len(scene.times) - 1, panels + 2)[1:-1].round().astype(int))
    else:
        clock = np.arange(scene.times[0], scene.times[-1] + 0.5 / rate, 1 / rate)
        frames = np.abs(scene.times[None] - clock[:, None]).argmin(axis=1)
    width, height = size or ((440, 620) if still else (480, 600))
    # Single pictures keep the head in their middle; in a clip the camera lags behind, so that the body is seen to move.
    detail, calm = detail or (PICTURE if still else CLIP), 0.02 if still else 0.3
    say = progress or (lambda done, total, message: None)
    with atomic_write(path) as part, closing(_Film(scene, width, height, detail, calm)) as film:
        with closing(film.shoot(frames, lambda done: say(done, len(frames), f"drawing {path.name}"))) as images:
            _WRITERS[kind](part, images, scene.times[frames], rate)
    return path


class _Film:
    """A scene with its camera, strands and colours made ready."""

    def __init__(self, scene: Scene, width: int, height: int, detail: Detail, calm: float):
        self.scene, self.detail, self._calm = scene, detail, calm
        self._pick(detail.strands)
        self._albedo = None if scene.body_rest is None else self._dress()
        self._cameras = self._follow()
        triangles = np.zeros((0, 3), int) if scene.triangles is None else scene.triangles
        self._canvas = open_canvas(width, height, triangles, len(self._tone), detail)

    def shoot(self, frames, say: Callable[[int], None] = lambda done: None) -> Iterator[np.ndarray]:
        """Pictures (height, width, 3) uint8 of frames; one is lit while the one before is drawn."""
        with ThreadPoolExecutor(1) as pool:
            ahead = pool.submit(self.light, int(frames[0]))
            for i, frame in enumerate(frames):
                lit = ahead.result()
                if i + 1 < len(frames):
                    ahead = pool.submit(self.light, int(frames[i + 1]))
                yield self._canvas.draw(self._cameras[frame], *lit)
                say(i + 1)

    def light(self, frame: int) -> tuple:
        """Body, its colours, hair and its colours: everything about a frame but the drawing itself."""
        scene, camera, shadow = self.scene, self._cameras[frame], None
        hair = tint = np.zeros((0, 3))
        if len(self._low):
            hair, tint, shadow = self._strands(frame)
        body, body_tint = None, np.zeros((0, 3))
        if scene.body is not None:
            body = np.asarray(scene.body(frame), float)
            normals = vertex_normals(body, scene.triangles)
            body_tint = shading.body_colours(body, normals, self._albedo, shadow, camera.to_eye, self._axes)
        return body, body_tint, hair, tint

    def _strands(self, frame: int) -> tuple:
        """Points and colours of all strands that are drawn, and the shadow that they throw."""
        scene, camera, head = self.scene, self._cameras[frame], self.scene.head[frame]
        own = self._own(scene.hair(frame))
        centre = head[:3, :3] @ scene.centre + head[:3, 3]
        counts = np.full(len(own), self.detail.vertices)
        tint, shadow = shading.hair_colours(own.reshape(-1, 3), counts, camera.to_eye, centre, self._axes, scene.look)
        hair = np.repeat(own, self._copies, axis=0) + self._beside @ head[:3, :3].T
        tint = np.repeat(tint.reshape(own.shape), self._copies, axis=0) * self._tone
        return hair.reshape(-1, 3), shading.srgb(tint.reshape(-1, 3)), shadow

    def close(self) -> None:
        self._canvas.close()

    def _pick(self, strands: int) -> None:
        """Which strands are drawn, how they are resampled, and where copies lie beside them."""
        scene, rng = self.scene, np.random.default_rng(3)
        starts = np.cumsum(scene.counts) - scene.counts
        usable = np.flatnonzero(scene.counts > 1)
        if not len(usable) and scene.mesh_hair is None:
            raise NeuralocksError("preview: the groom has no strand of two points; there is nothing to draw")
        rows = usable[:: max(1, -(-len(usable) // strands))]
        self._copies = copies = int(np.clip(round(strands / max(len(rows), 1)), 1, 12))
        place = np.linspace(0, 1, self.detail.vertices)[None] * (scene.counts[rows] - 1)[:, None]
        low = np.minimum(place.astype(int), scene.counts[rows, None] - 2)
        self._low, self._part = starts[rows, None] + low, (place - low)[..., None]
        roots = scene.rest[starts[usable]] if len(usable) else np.zeros((1, 3))
        spacing = 1.3 * np.sqrt(4 * np.pi * max(np.var(roots, axis=0).sum(), 1e-6) / len(roots))
        beside = rng.normal(0, 0.5 * spacing, (len(rows) * copies, 1, 3))
        beside[::copies] = 0
        self._tone = np.exp(rng.normal(0, 0.25, (len(rows) * copies, 1, 1)))
        # Copies keep apart along the strand but close up towards the tip, as locks do.
        self._beside = beside * np.linspace(1, 0.45, self.detail.vertices)[None, :, None]

    def _own(self, points: np.ndarray) -> np.ndarray:
        """The groom's own strands (S, detail.vertices, 3), resampled."""
        points = np.asarray(points, float)
        return points[self._low] * (1 - self._part) + points[self._low + 1] * self._part

    def _dress(self) -> np.ndarray:
        """Skin above the collar, dark cloth below, and mesh hair: linear RGB (V, 3)."""
        scene = self.scene
        below = (scene.centre[1] - scene.body_rest[:, 1] - 0.25) / 0.03
        cloth = np.clip(below, 0, 1)[:, None]
        result = (1 - cloth) * np.array(scene.look.skin) + cloth * np.array(scene.look.cloth)
        if scene.mesh_hair is not None:
            result[scene.mesh_hair] = scene.look.tip
        return result

    def _follow(self) -> list[Camera]:
        """One camera a frame: it goes along with the head's path, smoothed, and does not turn."""
        scene = self.scene
        centre = np.einsum("tij,j->ti", scene.head[:, :3, :3], scene.centre) + scene.head[:, :3, 3]
        reach = np.linalg.norm(scene.rest - scene.centre, axis=1).max()
        step = np.median(np.diff(scene.times)) if len(scene.times) > 1 else 1.0
        smooth = _blurred(centre, self._calm / step)
        # How far the head strays from the smooth path, so that a jump does not leave the picture.
        stray = np.abs(centre - smooth).max()
        high = 0.15 + 0.60 * min(reach, 0.6) + 0.5 * min(stray, 0.3)
        front = scene.facing.T @ np.array([0, 0, 1.0]) * [1, 0, 1]
        front /= np.linalg.norm(front)
        # Where the face looks on average, so that a shot of somebody's back does not show the back only.
        turned = np.einsum("tij,j->ti", scene.head[:, :3, :3], front).mean(axis=0) * [1, 0, 1]
        front = turned / np.linalg.norm(turned) if np.linalg.norm(turned) > 0.3 else front
        right = np.cross([0, 1.0, 0], front)
        self._axes = np.stack([right, [0, 1.0, 0], front], axis=1)
        direction = front + 0.62 * right + np.array([0, 0.10, 0])
        direction /= np.linalg.norm(direction)
        far = high / np.tan(np.radians(24.0) / 2)
        up = np.array([0, 1.0, 0])
        aim = smooth - up * 0.36 * min(reach, 0.6)
        return [Camera(a + far * direction, a, up) for a in aim]


def _blurred(values: np.ndarray, width: float) -> np.ndarray:
    from scipy.ndimage import gaussian_filter1d

    return gaussian_filter1d(values, max(width, 1e-3), axis=0, mode="nearest")


def _strip(part: Path, images: Iterator[np.ndarray], times: np.ndarray, rate: float) -> None:
    from PIL import Image, ImageDraw

    images = list(images)
    gap = np.full((images[0].shape[0], 4, 3), 255, np.uint8)
    row = [piece for image in images for piece in (gap, image)][1:]
    strip = Image.fromarray(np.concatenate(row, axis=1))
    pen, wide = ImageDraw.Draw(strip), images[0].shape[1] + 4
    for i, time in enumerate(times):
        pen.text((wide * i + 10, strip.height - 20), f"{time:.2f} s", fill=(230, 230, 230))
    strip.save(part)


def _gif(part: Path, images: Iterator[np.ndarray], times: np.ndarray, rate: float) -> None:
    from PIL import Image

    frames = (Image.fromarray(image).quantize(128, dither=Image.Dither.NONE) for image in images)
    first = next(frames)
    first.save(part, save_all=True, append_images=frames, duration=round(1000 / rate), loop=0, optimize=True)


def _mp4(part: Path, images: Iterator[np.ndarray], times: np.ndarray, rate: float) -> None:
    import imageio.v2 as imageio

    with imageio.get_writer(part, fps=rate, codec="libx264", quality=8, macro_block_size=2) as writer:
        for image in images:
            writer.append_data(image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2])


_WRITERS = {".png": _strip, ".mp4": _mp4, ".gif": _gif}


def _need(module: str) -> None:
    from importlib.util import find_spec

    if find_spec(module) is None:
        package = {"PIL": "pillow"}.get(module, module.replace("_", "-"))
        raise NeuralocksError(f"preview: {package} is not installed; pip install 'neuralocks[preview]'")
