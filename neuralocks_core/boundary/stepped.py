# SPDX-License-Identifier: Apache-2.0
"""Animation on twos, threes or fours, where each pose is held for some frames: the smooth motion through its poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.motion import Clip

LONGEST = 1 / 6 + 1e-3
"""A pose that is held longer [s], that is, more than four frames at 24 fps, is a stop."""
WINDOW, LEAST = 4, 3
"""Of WINDOW poses in a row, at least LEAST must be held: a single repeated frame, or a pause, is not a step."""
ROUNDING = 1e-6
"""Turns and positions that differ by no more than this, relative to the largest of their entries or to 2, are the same pose: USD
interpolates in float32 between equal keys."""
STEP = 10.0
"""Poses that differ by no more than this many times `ROUNDING` are not steps, but slow motion."""


@dataclass(frozen=True, eq=False)
class Stepped:
    """A clip as the motion that goes smoothly from each pose that it holds to the next. Parts that hold no poses stay as they are.

    Hair that felt each step would start and stop with it. Instead, it holds with the pose: while a pose is held, hair is as at
    the pose's first time.

    Attributes:
        clip: the samples at which poses first show; the clip itself if it is not stepped.
        held: numbers of samples for which poses are held, ascending, (n,).
    """

    clip: Clip
    held: np.ndarray
    _whole: Clip
    _first: np.ndarray

    @classmethod
    def of(cls, clip: Clip, joints: list[int]) -> Stepped:
        """Find the poses that a clip holds.

        Args:
            clip: without cuts.
            joints: those whose motion the hair reads, the chest second, as `joints_read` gives them.
        """
        ends, count = _held(clip.times, _changes(clip.joints, joints))
        if not len(count):  # a vehicle, or a root that is animated on ones, may carry a body on twos
            ends, count = _held(clip.times, _changes(clip.joints, joints, from_chest=True))
        if not len(count):
            return cls(clip, count, clip, clip.times)
        shown = np.arange(len(clip.times))  # per sample, the one whose pose it holds
        for end, held in zip(ends, count):
            shown[end - held : end] = end - held
        if clip.loop:  # the period stays
            shown[shown == shown[-1]] = len(shown) - 1
        kept = np.unique(shown)
        own = replace(clip, times=clip.times[kept], joints=clip.joints[kept], shape=clip.shape[kept])
        return cls(own, np.sort(count), clip, clip.times[shown])

    def times(self, times: np.ndarray) -> np.ndarray:
        """Times (n,) [s] of the smooth motion for times (n,) [s] of the animation. Before its beginning both are the same."""
        if not len(self.held):
            return times
        base = self._whole.wrapped(times)
        return np.interp(base, self._whole.times, self._first) + (times - base)


def _changes(joints: np.ndarray, read: list[int], from_chest: bool = False) -> np.ndarray:
    """How much the joints that are read change from each sample to the next (T - 1,), in units of what rounding may cause: in the
    world, or as seen from the second of them.
    """
    own, chest = joints[:, list(dict.fromkeys(read)), :3], joints[:, read[:2][-1], None, :3]
    changes = []
    for part in (slice(3), slice(3, 4)):  # far from the origin places are rounded more, but turns are not
        seen, size = own[..., part], max(2.0, np.abs(own[..., part]).max())
        if from_chest:
            away = chest[..., 3:] if part.stop == 4 else 0.0
            # A transpose serves as the inverse: whatever the scale, equal poses stay equal.
            seen = chest[..., :3].swapaxes(-1, -2) @ (seen - away)
        changes.append(np.abs(np.diff(seen, axis=0)).max(axis=(1, 2, 3)) / (ROUNDING * size))
    return np.maximum(*changes)


def _held(times: np.ndarray, changes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where poses that are held within motion end (n,), as the samples after them, and for how many samples each is held (n,). A
    stop that ends in such motion ends with a held pose.
    """
    none = np.zeros(0, int)
    first = np.flatnonzero(np.concatenate([[True], changes > 1]))  # of each run of equal samples
    if len(first) < WINDOW or len(first) == len(times):
        return none, none
    ends = np.append(first[1:], len(times))
    count = ends - first
    shows = np.append(times[first[1:]], 2 * times[-1] - times[-2]) - times[first]
    stop, sudden = shows > LONGEST, changes[first[1:] - 1] > STEP
    windows = [
        np.lib.stride_tricks.sliding_window_view(each, size)
        for each, size in ((count > 1, WINDOW), (sudden, WINDOW - 1))
    ]
    stepped = (windows[0].sum(axis=1) >= LEAST) & windows[1].all(axis=1)
    step = (count > 1) & ~stop & (np.convolve(stepped, np.ones(WINDOW, int)) > 0)
    before = np.flatnonzero(stop[:-1] & step[1:] & sudden)
    return np.append(ends[step], ends[before]), np.append(count[step], count[before + 1])
