# SPDX-License-Identifier: Apache-2.0
"""Animation on twos, threes or fours, where each pose is held for some frames: the smooth motion through its poses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.motion import Clip

LONGEST = 1 / 6 + 1e-3
"""A pose that shows for longer [s] than four frames at 24 a second is a stop."""
WINDOW, LEAST = 4, 3
"""Of so many poses in a row at least so many must be held: a frame that is repeated by itself, or a pause, is no step."""
ROUNDING = 1e-6
"""Turns, and places, that differ by no more, in relation to the largest of their entries or to 2, are the same pose: USD
interpolates in float32 between keys that hold."""
STEP = 10.0
"""Poses that differ by no more than so many times that are no steps, but slow motion."""


@dataclass(frozen=True, eq=False)
class Stepped:
    """A clip as the motion that goes smoothly from each pose that it holds to the next. What does not hold stays as it is.

    Hair that felt each step would start and stop with it. It holds with the pose: at a time at which a pose is held it is as at
    the first one.

    Attributes:
        clip: the samples at which poses first show; the clip itself where it is not stepped.
        held: how many samples the poses are held for that are held, ascending, (n,).
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
            joints: those of whose motion the hair knows.
        """
        ends, count = _held(clip.times, _changes(clip.joints, joints))
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
        """When (n,) [s] the smooth motion is where the animation is at times (n,) [s]. Before it begins these are the same."""
        if not len(self.held):
            return times
        base = self._whole.wrapped(times)
        return np.interp(base, self._whole.times, self._first) + (times - base)


def _changes(joints: np.ndarray, read: list[int]) -> np.ndarray:
    """How much the joints that are read change from each sample to the next (T - 1,), 1 being what rounding may do."""
    changes = []
    for part in (slice(3), slice(3, 4)):  # far from the origin places are rounded more, but turns are not
        change, size = np.zeros(len(joints) - 1), 2.0
        for joint in sorted(set(read)):
            own = joints[:, joint, :3, part]
            np.maximum(change, np.abs(np.diff(own, axis=0)).max(axis=(1, 2)), out=change)
            size = max(size, np.abs(own).max())
        changes.append(change / (ROUNDING * size))
    return np.maximum(*changes)


def _held(times: np.ndarray, changes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where poses end that are held while the motion goes on (n,), as the samples after them, and for how many samples each is
    held (n,). A stop that ends in such motion ends with a pose of it.
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
