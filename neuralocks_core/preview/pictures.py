# SPDX-License-Identifier: Apache-2.0
"""Pictures and clips of moving hair, on machines without a display."""

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import closing
from itertools import chain
from pathlib import Path

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path, atomic_write
from neuralocks_core.preview.film import AZIMUTH, Detail, Film, Scene
from neuralocks_core.progress import Progress, silent

SUFFIXES = (".png", ".mp4", ".gif")
PANELS, MOST_PANELS = 6, 12
"""Pictures of a strip, spread over its frames, and the most frames that are all shown."""
STRIP_SIZE, CLIP_SIZE = (440, 620), (480, 600)
"""Width and height of one picture [pixels], if nobody asks for others."""
STANDING = 4.0
"""Seconds that the camera takes to go round a single frame."""
LETTERS = 10, 1 / 38
"""Least size of a strip's letters [pixels], and their size as a share of a picture's height: wide strips are looked at reduced."""
PALETTE, DITHER = 5, 6.0
"""A .gif takes its colours from PALETTE frames of the clip; dithering changes them by DITHER of 255."""

PICTURE = Detail(16000, 24, 3, 2)
CLIP = Detail(4000, 12, 2, 3)
"""A quarter of the strands, wider, with half the vertices: in motion it looks the same, and it draws much faster."""


class LacksLibrary(NeuralocksError):
    """A library that writes such a file is not installed."""


def render(
    scene: Scene,
    path: str | os.PathLike,
    *,
    size: tuple[int, int] | None = None,
    frames: np.ndarray | None = None,
    azimuth: float = AZIMUTH,
    turntable: bool = False,
    rate: float = 24.0,
    detail: Detail | None = None,
    name: Callable[[float], str] = "{:.2f} s".format,
    progress: Progress | None = None,
) -> Path:
    """Write a strip of pictures (.png) or a clip (.mp4, .gif).

    Args:
        scene: what to draw.
        path: the file to write; its extension chooses the format.
        size: width and height of one picture in pixels; STRIP_SIZE or CLIP_SIZE if left out.
        frames: numbers of the scene's frames: a strip shows these, or PANELS of them if there are more than MOST_PANELS; a clip
            goes from the first to the last. If left out, a strip shows PANELS of all, a clip all.
        azimuth: where the camera is: degrees from the face to the character's left.
        turntable: whether the camera goes round once, beginning there; round a single frame, too.
        rate: frames per second of a clip, which plays in real time.
        detail: how finely; PICTURE or CLIP if left out.
        name: what a strip calls a time [s].
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: the extension is unknown, a library is missing (LacksLibrary), or the file cannot be written.
    """
    path = as_path(path, "path")
    if path.suffix.lower() not in SUFFIXES:
        raise NeuralocksError(f"{path}: unknown kind of picture; end it in {', '.join(SUFFIXES)}")
    kind = path.suffix.lower()
    _need("imageio_ffmpeg" if kind == ".mp4" else "PIL")
    still = kind == ".png"
    chosen = _still(scene, frames, turntable) if still else _played(scene, frames, rate, turntable)
    seen_from = azimuth + turntable * 360 * np.arange(len(chosen)) / len(chosen)
    if kind == ".gif":
        first = np.linspace(0, len(chosen) - 1, PALETTE).astype(int)
        chosen, seen_from = (np.concatenate([each[first], each]) for each in (chosen, seen_from))
    width, height = size or (STRIP_SIZE if still else CLIP_SIZE)
    # Single pictures keep the head in the middle; in a clip the camera lags behind, so that the body visibly moves.
    detail, calm = detail or (PICTURE if still else CLIP), 0.02 if still else 0.3
    say = progress or silent
    with atomic_write(path) as part, closing(Film(scene, width, height, detail, calm)) as film:
        say(0, len(chosen), f"drawing {path.name}")
        images = film.shoot(chosen, seen_from, lambda done: say(done, len(chosen), f"drawing {path.name}"))
        with closing(images):
            if still:
                views = zip(scene.times[chosen], seen_from)
                _strip(part, images, [name(time) + (f", {angle:.0f}°" if turntable else "") for time, angle in views])
            else:
                CLIPS[kind](part, images, len(chosen), rate)
            say(len(chosen), len(chosen), f"writing {path.name}")  # the last moment at which a caller may stop it
    return path


def _still(scene: Scene, frames, turntable: bool) -> np.ndarray:
    """Frames of a strip, of those that are asked for."""
    if frames is None:  # but the first and the last, which often show the rest pose
        places = np.linspace(0, len(scene.times) - 1, PANELS + 2)[1:-1]
        frames = np.unique(places.round().astype(int))
    if turntable and len(frames) == 1:
        return np.full(PANELS, frames[0])
    if len(frames) <= MOST_PANELS:
        return np.asarray(frames)
    return np.asarray(frames)[np.linspace(0, len(frames) - 1, PANELS).round().astype(int)]


def _played(scene: Scene, frames, rate: float, turntable: bool) -> np.ndarray:
    """Frames of a clip in real time from the first to the last of those that are asked for."""
    first, last = scene.times[[0, -1] if frames is None else [frames[0], frames[-1]]]
    if turntable and first == last:
        return np.full(round(STANDING * rate), 0 if frames is None else frames[0])
    return nearest(scene.times, np.arange(first, last + 0.5 / rate, 1 / rate))


def nearest(times: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """Numbers (n,) of the ascending times (T,) that lie nearest to those of a clock (n,); the earlier of two as near."""
    after = np.searchsorted(times, clock).clip(max=len(times) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(clock - times[before] <= np.abs(times[after] - clock), before, after)


def _strip(part: Path, images: Iterator[np.ndarray], names: list[str]) -> None:
    from PIL import Image, ImageDraw

    images = list(images)
    gap = np.full((images[0].shape[0], 4, 3), 255, np.uint8)
    row = [piece for image in images for piece in (gap, image)][1:]
    strip = Image.fromarray(np.concatenate(row, axis=1))
    pen, wide = ImageDraw.Draw(strip), images[0].shape[1] + 4
    size = max(LETTERS[0], round(LETTERS[1] * strip.height))
    for i, text in enumerate(names):
        pen.text((wide * i + size, strip.height - 2 * size), text, fill=(230, 230, 230), font_size=size)
    strip.save(part)


def _gif(part: Path, images: Iterator[np.ndarray], count: int, rate: float) -> None:
    """The first PALETTE pictures give the colours that all others share: so what stands still stays still."""
    from PIL import Image

    shown = np.stack([next(images) for _ in range(PALETTE)])
    _, height, width, _ = shown.shape
    pixels = Image.fromarray(shown[:, ::2, ::2].reshape(1, -1, 3))
    palette = pixels.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3)
    # Ordered dithering keeps the backdrop smooth, and still; error diffusion would crawl.
    pattern = np.tile(DITHER * (_bayer(8)[..., None] - 63 / 128), (height // 8 + 1, width // 8 + 1, 1))

    def reduced(image: np.ndarray):
        dithered = image + pattern[:height, :width]
        return Image.fromarray(dithered.clip(0, 255).astype(np.uint8)).quantize(palette=palette, dither=0)

    ends = np.round(np.arange(1, count - PALETTE + 1) * 100 / rate)  # a file counts hundredths of a second
    durations = (10 * np.diff(ends, prepend=0)).astype(int).tolist()
    frames = map(reduced, images)
    next(frames).save(part, save_all=True, append_images=frames, duration=durations, loop=0, optimize=True)


def _bayer(size: int) -> np.ndarray:
    """Thresholds (size, size), from 0 to less than 1, of ordered dithering (Bayer 1973); the size is a power of two."""
    if size == 1:
        return np.zeros((1, 1))
    finer = _bayer(size // 2)
    return np.block([[finer, finer + 2 / size**2], [finer + 3 / size**2, finer + 1 / size**2]])


def _mp4(part: Path, images: Iterator[np.ndarray], count: int, rate: float) -> None:
    import imageio_ffmpeg

    first = next(images)
    high, wide = (side // 2 * 2 for side in first.shape[:2])
    # The encoder's own default uses three times as many cores for the same size and look.
    fast = {"codec": "libx264", "quality": 8, "output_params": ["-preset", "veryfast"]}
    quiet = {"macro_block_size": 2, "ffmpeg_log_level": "quiet"}
    try:
        with closing(imageio_ffmpeg.write_frames(part, (wide, high), fps=rate, **fast, **quiet)) as encoder:
            encoder.send(None)
            for image in chain([first], images):
                encoder.send(np.ascontiguousarray(image[:high, :wide]))
    except OSError as error:
        if error.errno is not None:  # else the encoder has ended and accepts no more pictures
            raise
    if _frames_of(part) < count:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _frames_of(clip: Path) -> int:
    """Number of pictures that can be read back from a clip: the encoder's exit status is unknown."""
    import imageio_ffmpeg

    try:
        return imageio_ffmpeg.count_frames_and_secs(clip)[0]
    except RuntimeError:
        return 0


CLIPS = {".mp4": _mp4, ".gif": _gif}
"""Ending -> what writes such a clip; both are called alike."""


def _need(module: str) -> None:
    from importlib.util import find_spec

    if find_spec(module) is None:
        package = {"PIL": "pillow"}.get(module, module.replace("_", "-"))
        raise LacksLibrary(f'preview: {package} is not installed; pip install "neuralocks[preview]"')
