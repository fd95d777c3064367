# SPDX-License-Identifier: Apache-2.0
"""A scene of moving hair prepared for drawing: its strands, colours and camera."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.mesh import vertex_normals, welded_pieces
from neuralocks_core.preview import shading
from neuralocks_core.preview.camera import ANGLE, Camera
from neuralocks_core.preview.canvas import open_canvas

AZIMUTH, RAISED = 32.0, 0.085
"""Usual direction of the camera from the face to the character's left [degrees], and how far it looks down [rad]."""
LOCK_TONE = 0.15
"""Standard deviation of the logarithm of how light a piece of mesh hair is."""
FARTHEST = 0.6
"""Hair farther from the middle of the head than this [m] need not be in the picture: faces would be small."""
MARGIN = 1.06
"""How many times as large as hair on top and at the sides of the head a picture is at least."""
COLLAR = 0.25
"""How far below the middle of a grown-up's head clothes begin [m]."""
SLEEVES = 1.7
"""How many times as far aside as shoulders there are clothes below the neck at any height: in a T pose, arms are as high as
the collar."""


@dataclass(frozen=True)
class Detail:
    """How finely hair is drawn.

    Attributes:
        strands: how many are drawn: a selection from a larger groom, or a smaller groom's with copies beside them.
        vertices: of each strand.
        scale: how many times larger to draw before reducing.
        width: of a strand, in pixels of the larger drawing.
    """

    strands: int
    vertices: int
    scale: int
    width: int


@dataclass(frozen=True, eq=False)
class Scene:
    """What to draw, as arrays.

    Attributes:
        times: of the frames (T,) [s].
        head: rigid transforms bind world -> posed world of the head (T, 4, 4).
        facing: rotation (3, 3) whose transpose's third column is where the face looks in bind pose.
        centre: middle of the head in bind pose (3,) [m].
        counts: vertices of each strand (S,); none if all hair is mesh hair.
        rest: points of strands, or of mesh hair, in bind pose (P, 3) [m].
        hair: frame number -> strand points (P, 3) [m], world.
        triangles: of the body (F, 3), or None.
        body: frame number -> body points (V, 3) [m], world, or None.
        body_rest: body points in bind pose (V, 3) [m], or None.
        mesh_hair: vertices of the body that are hair (V,) bool, or None.
        cuts: times of the first frame after each cut (C,) [s]: no camera flies from one place to the other.
        size: how many times a person's size the character is.
        collar: heights in bind pose [m] between which clothes begin, lower first, such as shoulders and neck, and how far aside
            shoulders are [m]; None if unknown.
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
    cuts: np.ndarray = ()
    size: float = 1.0
    collar: tuple[float, float, float] | None = None

    def life_size(self) -> "Scene":
        """The same with a giant shrunk to a person's size, at which cameras and light know what is near."""
        if self.size == 1:
            return self
        share, head, hair, body = 1 / self.size, self.head.copy(), self.hair, self.body
        head[:, :3, 3] *= share
        return replace(
            self,
            head=head,
            centre=share * self.centre,
            rest=share * self.rest,
            hair=lambda frame: share * np.asarray(hair(frame), float),
            body=None if body is None else lambda frame: share * np.asarray(body(frame), float),
            body_rest=None if self.body_rest is None else share * self.body_rest,
            size=1.0,
            collar=self.collar and tuple(share * each for each in self.collar),
        )


class Film:
    """A scene prepared with camera, strands and colours.

    Args:
        scene: what to draw.
        width, height: of a picture in pixels.
        detail: how finely hair is drawn.
        calm: time [s] over which the camera's path is smoothed.
        canvas: draws; called as `canvas.open_canvas`.

    Raises:
        NeuralocksError: there is nothing to draw.
    """

    def __init__(self, scene: Scene, width: int, height: int, detail: Detail, calm: float, canvas=open_canvas):
        self.scene, self.detail, self._calm = (scene := scene.life_size()), detail, calm
        self._pick(detail.strands)
        self._albedo = None if scene.body_rest is None else self._dress()
        self._follow(width / height)
        triangles = np.zeros((0, 3), int) if scene.triangles is None else scene.triangles
        self._canvas = canvas(width, height, triangles, len(self._tone), detail)

    def shoot(self, frames, azimuth=AZIMUTH, say: Callable[[int], None] = lambda done: None) -> Iterator[np.ndarray]:
        """Pictures (height, width, 3) uint8 of frames (n,), each seen from its azimuth (n,), or all from one: degrees from the
        face to the character's left. Two are lit while the one before is drawn.
        """
        views = list(zip(map(int, frames), np.broadcast_to(azimuth, len(frames)), strict=True))
        with ThreadPoolExecutor(2) as pool:
            ahead = [pool.submit(self.light, *view) for view in views[:2]]
            for i, view in enumerate(views):
                lit = ahead.pop(0).result()
                ahead += [pool.submit(self.light, *after) for after in views[i + 2 : i + 3]]
                yield self._canvas.draw(self._camera(*view), *lit)
                say(i + 1)

    def light(self, frame: int, azimuth: float) -> tuple:
        """Body, its colours, hair and its colours: everything about a frame but the drawing itself."""
        scene, shadow = self.scene, None
        to_eye, lights = self._camera(frame, azimuth).to_eye, self._towards(frame, azimuth - AZIMUTH)
        hair = tint = np.zeros((0, 3))
        if len(self._low):
            hair, tint, shadow = self._strands(frame, to_eye, lights)
        body, body_tint = None, np.zeros((0, 3))
        if scene.body is not None:
            body = np.asarray(scene.body(frame), float)
            normals = vertex_normals(body, scene.triangles)
            body_tint = shading.body_colours(body, normals, self._albedo, shadow, to_eye, lights)
        return body, body_tint, hair, tint

    def _strands(self, frame: int, to_eye: np.ndarray, lights: np.ndarray) -> tuple:
        """Points and colours of all strands that are drawn, and the shadow that they throw."""
        scene, head = self.scene, self.scene.head[frame]
        own = self._own(scene.hair(frame))
        centre = head[:3, :3] @ scene.centre + head[:3, 3]
        tint, shadow = shading.hair_colours(own, to_eye, centre, lights)
        hair = np.repeat(own, self._copies, axis=0) + self._beside @ head[:3, :3].T
        tint = np.repeat(tint, self._copies, axis=0) * self._tone
        return hair.reshape(-1, 3), shading.srgb(tint.reshape(-1, 3)), shadow

    def close(self) -> None:
        """Free the resources of the canvas."""
        self._canvas.close()

    def _pick(self, strands: int) -> None:
        """Choose the strands to draw, how they are resampled, and the offsets of their copies."""
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
        # Copies stay apart along the strand but converge towards the tip, as locks do.
        self._beside = beside * np.linspace(1, 0.45, self.detail.vertices)[None, :, None]

    def _own(self, points: np.ndarray) -> np.ndarray:
        """The groom's own strands (S, detail.vertices, 3), resampled."""
        points = np.asarray(points, float)
        return points[self._low] * (1 - self._part) + points[self._low + 1] * self._part

    def _dress(self) -> np.ndarray:
        """Skin above the collar, dark cloth below, and mesh hair: linear RGB (V, 3)."""
        scene = self.scene
        height, collar = scene.body_rest[:, 1], scene.centre[1] - COLLAR
        if scene.collar is None:
            below = collar - height
        else:
            shoulder, neck, apart = scene.collar
            # A child's head is nearer to its shoulders, a large one farther from its neck.
            below = min(max(collar, shoulder), neck) - height
            aside = np.abs((scene.body_rest - scene.centre) @ scene.facing[0])
            below = np.where(height < neck, np.maximum(below, aside - SLEEVES * apart), below)  # a head may be wider
        cloth = np.clip(below / 0.03, 0, 1)[:, None]
        result = (1 - cloth) * shading.SKIN + cloth * shading.CLOTH
        if scene.mesh_hair is not None:
            result[scene.mesh_hair] = self._locks()[scene.mesh_hair]
        return result

    def _locks(self) -> np.ndarray:
        """Mesh hair, darker near the head, each piece in a tone of its own: linear RGB (V, 3)."""
        scene = self.scene
        far = np.linalg.norm(scene.body_rest - scene.centre, axis=1)
        near, farthest = np.percentile(far[scene.mesh_hair], [0, 100])
        light = 0.3 + 0.7 * ((far - near) / max(farthest - near, 1e-6))[:, None].clip(0, 1)
        piece = welded_pieces(scene.body_rest, scene.triangles[scene.mesh_hair[scene.triangles].all(axis=1)])
        tone = np.exp(np.random.default_rng(5).normal(0, LOCK_TONE, piece.max() + 1))[piece, None]
        return tone * ((1 - light) * shading.ROOT + light * shading.TIP)

    def _follow(self, shape: float) -> None:
        """Where cameras look, how far away they are, and where the face looks on average between cuts. Cameras go along with the
        head's path, smoothed between cuts, but do not turn with it. `shape` is a picture's width by its height.
        """
        scene = self.scene
        centre = np.einsum("tij,j->ti", scene.head[:, :3, :3], scene.centre) + scene.head[:, :3, 3]
        step = np.median(np.diff(scene.times)) if len(scene.times) > 1 else 1.0
        after = np.searchsorted(scene.times, np.asarray(scene.cuts) - 1e-9)
        takes = [take for take in np.split(np.arange(len(centre)), after) if len(take)]
        smooth = np.concatenate([_blurred(centre[take], self._calm / step) for take in takes])
        # How far the head strays from the smooth path, so that it stays in the picture during a jump.
        stray = np.abs(centre - smooth).max()
        reach, aside, above = self._extent()
        down = 0.36 * reach
        high = max(0.15 + 0.60 * reach, MARGIN * (above + down), MARGIN * aside / shape) + 0.6 * min(stray, 0.3)
        self._front = np.concatenate([np.tile(self._faced(take), (len(take), 1)) for take in takes])
        self._aims = smooth - [0, down, 0]
        self._far = high / np.tan(np.radians(ANGLE) / 2)

    def _faced(self, frames: np.ndarray) -> np.ndarray:
        """The average direction of the face (3,), so that a shot in which the character turns does not show only its back."""
        front = self.scene.facing.T @ np.array([0, 0, 1.0]) * [1, 0, 1]
        front /= np.linalg.norm(front)
        turned = np.einsum("tij,j->ti", self.scene.head[frames, :3, :3], front).mean(axis=0) * [1, 0, 1]
        return turned / np.linalg.norm(turned) if np.linalg.norm(turned) > 0.3 else front

    def _extent(self) -> tuple[float, float, float]:
        """How far hair reaches from the middle of the head, how far to any side, and how far above it hair or head reach [m]."""
        scene = self.scene
        hair = scene.rest - scene.centre
        reach = np.linalg.norm(hair, axis=1).max()
        aside, above = np.linalg.norm(hair[:, [0, 2]], axis=1).max(), hair[:, 1].max()
        if scene.body_rest is not None:
            body = scene.body_rest - scene.centre
            over = body[np.linalg.norm(body[:, [0, 2]], axis=1) < min(reach, 0.1), 1]
            above = max(above, over.max(initial=0))
        return tuple(min(float(far), FARTHEST) for far in (reach, aside, above))

    def _camera(self, frame: int, azimuth: float) -> Camera:
        up, aim = np.array([0, 1.0, 0]), self._aims[frame]
        direction = self._towards(frame, azimuth)[:, 2] + RAISED * up
        return Camera(aim + self._far * direction / np.linalg.norm(direction), aim, up)

    def _towards(self, frame: int, azimuth: float) -> np.ndarray:
        """Axes (3, 3), columns right, up and towards somebody at that azimuth. Lights go round with the camera, so that no side
        is in the dark.
        """
        aside, up, front = np.radians(azimuth), np.array([0, 1.0, 0]), self._front[frame]
        towards = np.cos(aside) * front + np.sin(aside) * np.cross(up, front)
        return np.stack([np.cross(up, towards), up, towards], axis=1)


def _blurred(values: np.ndarray, width: float) -> np.ndarray:
    """Values (n, 3) smoothed over about so many samples; at both ends they go on as they went, so that nobody runs out of the picture."""
    from scipy.ndimage import gaussian_filter1d

    width = max(width, 1e-3)
    beyond = min(len(values) - 1, int(4 * width) + 1)
    longer = np.pad(values, ((beyond, beyond), (0, 0)), mode="reflect", reflect_type="odd")
    return gaussian_filter1d(longer, width, axis=0, mode="nearest")[beyond : beyond + len(values)]
