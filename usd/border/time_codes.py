# SPDX-License-Identifier: Apache-2.0
"""Which time codes a bake writes."""

import math
from fractions import Fraction

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.number_words import plain_number

from .amounts import check_number

MOST = 1_000_000
NEAR = 1e-3
"""A time code nearer to a frame than this share of a frame was rounded from it."""
NEARER = 1e-5
"""A time code nearer than this share to a simple part of a frame was rounded from that part."""
MOST_SUBFRAMES = 64


def parse_frames(text: str, frame: float) -> tuple[float, float, float]:
    """`FIRST:LAST[:STEP]` or a single `FIRST` as (first, last, step); the step is a frame, `frame` time codes, if left out.

    Raises:
        NeuralocksError: it is something else.
    """
    try:
        parts = [plain_number(part) for part in text.split(":")]
    except ValueError:
        parts = []
    if not 1 <= len(parts) <= 3 or not all(math.isfinite(p) for p in parts):
        raise NeuralocksError(f"--frames {text}: is not FIRST:LAST[:STEP]; write for example 1:48")
    first, last, step = parts[0], parts[1] if len(parts) > 1 else parts[0], parts[2] if len(parts) > 2 else frame
    if last < first or step <= 0:
        raise NeuralocksError(
            f"--frames {text}: the range is empty; LAST must not lie before FIRST, and STEP must be above 0"
        )
    return first, last, step


def time_codes(frames, first: float, last: float, subframes: int = 1, frame: float = 1.0, samples=()) -> list[float]:
    """Ascending time codes without duplicates.

    Args:
        frames: None for the whole range, `FIRST:LAST[:STEP]`, or any iterable of time codes.
        first, last: the shot's range.
        subframes: samples per frame: n adds the n - 1 times at equal steps after each frame, for motion blur.
        frame: time codes from one frame to the next.
        samples: those of the animation, which tell where frames are if the range begins between whole numbers.

    Raises:
        NeuralocksError: no frame, too many, or something that is not a time code.
    """
    check_number("--subframes", subframes, 1, MOST_SUBFRAMES, whole=True)
    if frames is None or isinstance(frames, str):
        begin, end, step = _whole_range(first, last, frame, samples) if frames is None else parse_frames(frames, frame)
        begin, end = on_frame(begin, first, frame), on_frame(end, first, frame)
        count = (end - begin) / step + (NEAR if frames is None else 1e-6)  # may overflow to infinity
        if not count * subframes < MOST:
            raise NeuralocksError(f"frames: more than {MOST} samples; give fewer with --frames FIRST:LAST:STEP")
        count = math.floor(count) + 1
        whole = [on_frame(begin + i * step, first, frame) for i in range(count)]
    else:
        whole = _numbers(frames, "frames")
    if not whole or not all(math.isfinite(code) for code in whole):
        raise NeuralocksError("frames: none given, or not finite; give at least one time code")
    parts = [part * frame / subframes for part in range(subframes)]
    return sorted({on_frame(code + part, first, frame) for code in whole for part in parts})


def on_frame(code: float, first: float, frame: float) -> float:
    """A time code to nine digits. If a frame is not one time code, it becomes the shot's frame, or simple part of one, that was
    meant. So the same time is the same number in every part of a range, however the ends of parts were rounded.
    """
    count = (code - first) / frame
    if frame != 1 and math.isfinite(count):
        whole, part = round(count), Fraction(count).limit_denominator(MOST_SUBFRAMES)
        if abs(whole - count) < NEAR:
            code = first + frame * whole
        elif abs(part - count) < NEARER:
            code = first + frame * float(part)
    return round(code, 9)


def given_cuts(cuts, loop: bool = False) -> list[float] | None:
    """Time codes of cuts, ascending, without duplicates; None if they are to be detected. A loop has none, whatever its clip looks
    like.

    Raises:
        NeuralocksError: some are given for a loop.
    """
    given = None if cuts is None else sorted(set(_numbers(cuts, "cuts", ", or [] if there are none")))
    if loop and given:
        raise NeuralocksError("--cuts: a loop has none; leave out --loop")
    return [] if loop else given


def _whole_range(first: float, last: float, frame: float, samples) -> tuple[float, float, float]:
    """First and last time code of a shot's frames, and from one to the next."""
    # If a time code is a frame, frames are whole numbers, unless the animation has all its samples between them, as the range begins;
    # otherwise the shot begins with a frame.
    between = _off(first) > NEAR and len(samples) > 0 and all(_off(code - first) < NEAR for code in samples)
    begin = float(math.ceil(first - NEAR)) if frame == 1 and not between else first
    return begin, max(last, begin), frame


def _off(code: float) -> float:
    """How far a number is from a whole one."""
    return abs(code - round(code))


def _numbers(codes, name: str, otherwise: str = "") -> list[float]:
    """Time codes that a caller gives for the argument `name`; `otherwise` is what it may be besides a list of some."""
    try:
        return [float(code) for code in (None if isinstance(codes, str) else codes)]
    except (TypeError, ValueError):
        raise NeuralocksError(
            f"{name}: {codes!r} holds no time codes; give a list such as [25, 49]{otherwise}"
        ) from None
