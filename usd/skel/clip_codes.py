# SPDX-License-Identifier: Apache-2.0
"""At which time codes a skeleton's animation is read."""

import numpy as np
from pxr import Usd

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import LARGEST_CLIP

from ..border.units import Border
from .joints import JointSource
from .keys import changes

CLOSE = 1.5 / 24
"""Samples at most this far apart [s] count as one for every frame, at whatever rate the stage runs."""
SAME = 1e-4
"""Samples nearer to each other than this, in frames, are one: layer offsets and other programs' clocks separate what was keyed
together, and over so little time a rounding error of a pose is a blow."""
STEP = 0.25
"""Samples at most this far apart, in frames, may be the two sides of a step, which programs write for held keys."""
ALONE = 4.0
"""They are if the next samples are more than this many times as far away. A smooth curve through both sides would overshoot far,
also before the step: so only the later sample counts, and the step takes a frame, as if each frame had a sample."""
STAND = 0.1
"""If a shot begins at least this long [s] before its samples, the character stands until they begin. An exporter's range is often a
frame or two wider than its samples: a character that stood before them would start with a blow."""


def clip_codes(source: JointSource, border: Border) -> np.ndarray:
    """Ascending time codes (T,): the samples of the body's animation, those of a face or a parent and every frame in gaps wider than
    CLOSE, and the ends of a shot where the character stands before or after its samples. If these are too many to hold, one for
    every frame, with a note.

    Raises:
        NeuralocksError: there are too many.
    """
    frame = border.frame
    stand = (STAND - 1e-9) * border.rate
    samples = source.keys.read((CLOSE + 1e-9) * border.rate, stand)
    if not samples:
        return np.zeros(1)
    samples = sorted({*samples, *_held_from(source)})
    first, last = samples[0], samples[-1]

    def held(first: float, last: float, count: int) -> bool:
        """Whether frames and this many samples fit in memory; for infinite times they do not."""
        return ((last - first) / frame + count) * len(source.names) <= LARGEST_CLIP

    if held(first, last, 2) and not held(first, last, len(samples)):
        source.notes.append(
            f"{source.path}: its animation has {len(samples):,} samples of {len(source.names)} joints, too many to hold in memory; it is "
            "read once per frame"
        )
        samples = [first, last]
    stage = source.prim.GetStage()
    if stage.HasAuthoredTimeCodeRange():
        # Exporters leave out samples in which nothing changes: what is held at either end of the shot is held.
        start, end = stage.GetStartTimeCode(), stage.GetEndTimeCode()
        start, end = start if first - start >= stand else first, max(end, last)
        if held(start, end, len(samples)):
            samples = [start, *samples, end]
            first, last = start, end
    if not held(first, last, len(samples)):
        raise NeuralocksError(
            f"{source.path}: its animation spans time codes {first:g} to {last:g}, too many samples to hold in memory; "
            "remove stray keys, or samples and joints that the shot does not need"
        )
    begin = np.ceil(first) if frame == 1 else first
    frames = begin + frame * np.arange(np.floor((last - begin) / frame + 1e-9) + 1)
    samples, steps = _after_steps(np.unique(samples), frame)
    ahead = np.append(steps, np.inf)[np.searchsorted(steps, frames, side="right")] - frames
    frames = frames[ahead >= STEP * frame]
    # Between close samples a frame would only add their chord, whose kinks are not motion of the body.
    near = np.searchsorted(samples, frames, side="right").clip(1, max(len(samples) - 1, 1))
    wide = np.diff(samples, append=samples[-1])[near - 1] > CLOSE * border.rate
    codes = np.unique(np.concatenate([frames[wide], samples]))
    return codes[np.diff(codes, append=np.inf) > SAME * frame]  # of a step's two samples the one after it


def _held_from(source: JointSource) -> list[float]:
    """The time code from which the first pose is held, if a writer that leaves out samples in which nothing changes has left it out.
    Such writers give what is held at first as the default value, too, and their layer begins before the first sample.
    """
    begins, firsts = [], []
    for channel in source.channels:
        times = channel.GetTimeSamples()
        if changes(times, channel.Get):
            default = channel.Get(Usd.TimeCode.Default())
            if default is None or not np.array_equal(default, channel.Get(times[0])):
                return []
            begins += _layer_start(channel)
            firsts.append(times[0])
    return [begin for begin in begins[:1] if begin < min(firsts)]


def _layer_start(channel: Usd.Attribute) -> list[float]:
    """Where the layer begins that holds an attribute's samples, in the stage's time codes, if it tells."""
    for spec, offset in channel.GetPropertyStackWithLayerOffsets():
        if spec.layer.GetNumTimeSamplesForPath(spec.path):
            return [offset * spec.layer.startTimeCode] if spec.layer.HasStartTimeCode() else []
    return []


def _after_steps(samples: np.ndarray, frame: float) -> tuple[np.ndarray, np.ndarray]:
    """Ascending samples (n,) without those on the earlier sides of steps, and where the steps are then (m,)."""
    gaps = np.diff(samples, prepend=-np.inf, append=np.inf)
    first = np.flatnonzero(gaps[:-1] >= STEP * frame)  # of each run of close samples
    if len(first) == 1:
        return samples, samples[:0]  # this is all the motion there is
    last = np.append(first[1:], len(samples)) - 1
    span = samples[last] - samples[first]
    step = (first < last) & (span < STEP * frame) & (ALONE * span < np.minimum(gaps[first], gaps[last + 1]))
    kept = np.ones(len(samples), bool)
    for i, j in zip(first[step], last[step]):
        kept[i:j] = False
    return samples[kept], samples[last[step]]
