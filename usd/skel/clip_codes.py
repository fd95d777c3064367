# SPDX-License-Identifier: Apache-2.0
"""At which time codes a skeleton's animation is read."""

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import LARGEST_CLIP

from ..border.units import Border
from .joints import JointSource

CLOSE = 1.5 / 24
"""Samples at most this far apart [s] are one for every frame, at whatever rate the stage runs."""
SAME = 1e-4
"""Samples nearer to each other, in frames, are one: layer offsets and other programs' clocks part what was keyed together,
and over so little time a rounding error of a pose is a blow."""
STAND = 0.1
"""A shot that begins at least so long [s] before its samples shows a character that stands meanwhile. An exporter's range is
often a frame or two wider than its samples: standing before them, it would start with a blow."""


def clip_codes(source: JointSource, border: Border) -> np.ndarray:
    """Ascending time codes (T,): the animation's samples, every frame in gaps wider than CLOSE, and the ends of a shot where
    the character stands before or after its samples.

    Raises:
        NeuralocksError: there are too many.
    """
    frame = border.frame
    samples = source.samples
    if not samples:
        return np.zeros(1)
    first, last = samples[0], samples[-1]
    stage = source.prim.GetStage()
    if stage.HasAuthoredTimeCodeRange():
        # Exporters leave out samples in which nothing changes: what is held at either end of the shot is held.
        start, end, stand = stage.GetStartTimeCode(), stage.GetEndTimeCode(), (STAND - 1e-9) * border.rate
        start, end = start if first - start >= stand else first, max(end, last)
        if ((end - start) / frame + len(samples)) * len(source.names) <= LARGEST_CLIP:
            samples = [start, *samples, end]
            first, last = start, end
    count = (last - first) / frame + len(samples)
    if not np.isfinite(count) or count * len(source.names) > LARGEST_CLIP:
        raise NeuralocksError(
            f"{source.path}: its animation spans time codes {first:g} to {last:g}, too many samples to hold; "
            "remove stray keys, or samples and joints that the shot does not need"
        )
    begin = np.ceil(first) if frame == 1 else first
    frames = begin + frame * np.arange(np.floor((last - begin) / frame + 1e-9) + 1)
    samples = np.unique(samples)
    # Between close samples a frame would only add their chord, whose kinks are no motion of the body.
    near = np.searchsorted(samples, frames, side="right").clip(1, max(len(samples) - 1, 1))
    wide = np.diff(samples, append=samples[-1])[near - 1] > CLOSE * border.rate
    codes = np.unique(np.concatenate([frames[wide], samples]))
    return codes[np.diff(codes, append=np.inf) > SAME * frame]  # of a step's two samples the one after it
