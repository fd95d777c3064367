# SPDX-License-Identifier: Apache-2.0
"""World transforms of all joints at any time of a clip, by the spline that the network's reading of the head goes along."""

import numpy as np

from neuralocks_core import rotation
from neuralocks_core.motion import Clip
from neuralocks_core.track import extended


class SmoothMotion:
    """A clip whose motion between its samples is that of a C2 spline, as `Track` has it of a few joints.

    `Clip.at` goes along straight lines: what is simulated on them feels a blow at every sample. Outside of the clip, the
    nearest sample is held; a loop goes on, and a character that walks in it gets ahead.

    Args:
        clip: without cuts.
    """

    def __init__(self, clip: Clip):
        from scipy.interpolate import CubicSpline  # as in `Track`

        self._clip = clip
        times, poses = extended(clip)
        linear = poses[..., :3, :3]
        turns, stretch = rotation.polar(linear)
        quaternions = rotation.continuous(rotation.to_quaternion(turns))
        values = np.concatenate([poses[..., :3, 3], quaternions, stretch.reshape(*linear.shape[:2], 9)], axis=-1)
        self._spline = CubicSpline(times, values, bc_type="natural") if len(times) > 1 else None
        self._only = values[:1]

    def at(self, times: np.ndarray) -> np.ndarray:
        """World joint transforms (n, J, 4, 4) [m] at times (n,) [s]."""
        clip, base = self._clip, self._clip.wrapped(times)
        values = self._only.repeat(len(times), axis=0) if self._spline is None else self._spline(base)
        result = np.tile(np.eye(4), (*values.shape[:2], 1, 1))
        result[..., :3, :3] = rotation.from_quaternion(values[..., 3:7]) @ values[..., 7:].reshape(
            *values.shape[:2], 3, 3
        )
        result[..., :3, 3] = values[..., :3]
        if clip.loop:
            laps = np.round((times - base) / max(clip.end - clip.start, 1e-9))
            # One way for all joints, or what a loop's ends lack of being alike would add up.
            drift = (clip.joints[-1] - clip.joints[0])[:, :3, 3].mean(axis=0)
            result[..., :3, 3] += laps[:, None, None] * drift
        return result
