# SPDX-License-Identifier: Apache-2.0
"""A clip of body motion, and its value at any time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.arguments import flag, number_array
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import angle_between, flat, from_vector, polar, to_vector

G = 9.81
"""Size of gravity [m/s^2]."""
GRAVITY = np.array([0.0, -G, 0.0])
"""[m/s^2], Y up."""
LARGEST_CLIP = 4_000_000
"""Most joint samples of one file's animation: 512 MB. More come from a stray key frame, not from a shot."""
LOOP_GAP = 2.0
"""Turn of a joint from the last sample of a loop to its first [degrees] beyond which a user is told."""

_WANTED = {"times": "(T,) seconds", "joints": "(T, J, 4, 4)", "shape": "(T, B) weights", "cuts": "(C,) seconds"}


@dataclass(frozen=True, eq=False)
class Clip:
    """World transforms of every joint over time.

    World, not local: constraints, inverse kinematics, drivers and moved roots are already in them.

    Attributes:
        times: ascending sample times, (T,) [s].
        joints: world transforms, (T, J, 4, 4) [m].
        shape: blend shape weights, (T, B) or (T, 0).
        loop: whether the motion repeats, the last sample showing the pose of the first; history is then taken modulo the
            period.
        cuts: times [s] of the first sample after each cut, ascending, (C,): no history reaches back across one. A loop has
            none that count.
    """

    times: np.ndarray
    joints: np.ndarray
    shape: np.ndarray = None
    loop: bool = False
    cuts: np.ndarray = ()

    def __post_init__(self):
        for name, wanted in _WANTED.items():
            given = getattr(self, name)
            if name != "shape" or given is not None:
                object.__setattr__(self, name, number_array(f"animation's {name}", given, wanted))
        object.__setattr__(self, "loop", flag("animation's loop", self.loop))
        if self.times.ndim != 1:
            raise NeuralocksError(f"animation: its times are of shape {self.times.shape}; give (T,) seconds")
        count = len(self.times)
        shape = np.zeros((count, 0)) if self.shape is None else self.shape
        object.__setattr__(self, "shape", shape)
        if not count:
            raise NeuralocksError("animation: it has no samples; animate the skeleton over the frames to bake")
        if self.joints.ndim != 4 or self.joints.shape[0] != count or self.joints.shape[2:] != (4, 4):
            raise NeuralocksError(
                f"animation: {self.joints.shape} transforms for {count} times; give one (J, 4, 4) per time"
            )
        if shape.ndim != 2 or len(shape) != count:
            raise NeuralocksError(
                f"animation: {shape.shape} blend shape weights for {count} times; give one row per time"
            )
        if (np.diff(self.times) <= 0).any():
            raise NeuralocksError("animation: sample times do not ascend; sort them and remove doubles")
        if self.cuts.ndim != 1 or not np.isfinite(self.cuts).all():
            raise NeuralocksError(f"animation: cuts at {self.cuts} s; give finite times, one a cut")
        bad = ~np.isfinite(self.joints).all(axis=(1, 2, 3)) | ~np.isfinite(shape).all(axis=1) | ~np.isfinite(self.times)
        if bad.any():
            raise NeuralocksError(
                f"animation: NaN or infinity at {self.times[bad][0]:.4g} s; repair the animation there"
            )

    @property
    def start(self) -> float:
        """First sample time [s]."""
        return float(self.times[0])

    @property
    def end(self) -> float:
        """Last sample time [s]."""
        return float(self.times[-1])

    @property
    def period(self) -> float:
        """Time after which the motion repeats [s]; 0 if it does not."""
        return self.end - self.start if self.loop else 0.0

    @property
    def parts(self) -> list[Clip]:
        """The clip from each cut up to the next; the clip itself if there is none."""
        if self.loop or not len(self.cuts):
            return [self]
        starts = np.searchsorted(self.times, self.cuts - 1e-9)
        bounds = np.unique([0, *starts[starts < len(self.times)], len(self.times)])
        return [
            replace(self, times=self.times[a:b], joints=self.joints[a:b], shape=self.shape[a:b], cuts=())
            for a, b in zip(bounds[:-1], bounds[1:])
        ]

    def at(self, times) -> np.ndarray:
        """World joint transforms (n, J, 4, 4) at any times (n,) [s].

        Between samples, translation and stretch are linear and rotation takes the shortest arc; outside, the nearest
        sample is held (or the loop continues).
        """
        times = self.wrapped(time_array(times))
        low, fraction = self._bracket(times)
        result, between = self.joints[low], fraction >= 1e-9
        # Blending nothing takes as long as blending a pose, and in a crowd, each clip is asked for its ends by all others.
        if between.any():
            low = low[between]
            result[between] = _blend(self.joints[low], self.joints[low + 1], fraction[between])
        return result

    def shape_at(self, times) -> np.ndarray:
        """Blend shape weights (n, B) at times (n,) [s], linear between samples."""
        times = self.wrapped(time_array(times))
        if not self.shape.shape[1]:  # most clips have none, and live hair asks in every frame
            return np.zeros((len(times), 0))
        low, fraction = self._bracket(times)
        high = np.minimum(low + 1, len(self.times) - 1)
        return (1 - fraction)[:, None] * self.shape[low] + fraction[:, None] * self.shape[high]

    def wrapped(self, times: np.ndarray) -> np.ndarray:
        """Times inside the clip: clamped, or modulo the period of a loop.

        Raises:
            NeuralocksError: a time is NaN, or infinite in a loop.
        """
        if np.isnan(times).any():
            raise NeuralocksError("times: hold NaN; give seconds")
        if self.period > 0:
            if np.isinf(times).any():
                raise NeuralocksError("times: hold infinity, where a loop has no pose; give seconds")
            inside = (times >= self.start) & (times <= self.end)
            return np.where(inside, times, self.start + np.mod(times - self.start, self.period))
        return np.clip(times, self.start, self.end)

    def _bracket(self, times):
        if len(self.times) == 1:
            return np.zeros(len(times), int), np.zeros(len(times))
        low = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        fraction = (times - self.times[low]) / (self.times[low + 1] - self.times[low])
        # An exact sample time must be returned unchanged, also the last one.
        low, fraction = (
            np.where(fraction > 1 - 1e-9, low + 1, low),
            np.where(fraction > 1 - 1e-9, 0.0, fraction),
        )
        return low, fraction


def time_array(given) -> np.ndarray:
    """Times (n,) [s] that a caller gives, one or several.

    Raises:
        NeuralocksError: these are no numbers, or not in one row.
    """
    times = np.atleast_1d(number_array("times", given, "(n,) seconds"))
    if times.ndim > 1:
        raise NeuralocksError(f"times: are of shape {times.shape}; give (n,) seconds")
    return times


def loop_turns(ends: np.ndarray) -> np.ndarray:
    """How far each joint is turned (J,) [degrees] between the transforms (2, J, 4, 4) in the world of a loop's first and last
    sample; 0 for joints that are scaled to zero.
    """
    linear = np.asarray(ends)[..., :3, :3]
    turns = np.degrees(angle_between(*polar(linear)[0]))
    return np.where(flat(linear).any(axis=0), 0.0, turns)


def _blend(a: np.ndarray, b: np.ndarray, fraction: np.ndarray) -> np.ndarray:
    """Transforms (n, J, 4, 4) between a and b at fractions (n,); rotation, stretch and translation each separately."""
    fraction = fraction[:, None, None, None]
    (turn_a, stretch_a), (turn_b, stretch_b) = (polar(m[..., :3, :3]) for m in (a, b))
    turn = from_vector(fraction[..., 0] * to_vector(np.swapaxes(turn_a, -1, -2) @ turn_b))
    result = (1 - fraction) * a + fraction * b
    result[..., :3, :3] = turn_a @ turn @ ((1 - fraction) * stretch_a + fraction * stretch_b)
    return result
