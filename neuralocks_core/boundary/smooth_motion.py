# SPDX-License-Identifier: Apache-2.0
"""World transforms of all joints at any time of a clip, by the same spline along which the network reads the head."""

import numpy as np

from neuralocks_core import rotation
from neuralocks_core.boundary.clip_spline import ClipSpline
from neuralocks_core.character import Character
from neuralocks_core.motion import Clip


class SmoothMotion:
    """A clip whose motion between its samples, and outside them, is that of `ClipSpline`, as `Track` has it for a few joints.

    `Clip.at` is linear between samples: a simulation on it would feel a blow at every sample.

    Args:
        character: whose motion it is; before the clip, all joints move with its head.
        clip: without cuts.
    """

    def __init__(self, character: Character, clip: Clip):
        self._spline = ClipSpline(clip, character.head_place, _numbers)

    def at(self, times: np.ndarray) -> np.ndarray:
        """World joint transforms (n, J, 4, 4) [m] at times (n,) [s]."""
        values, moved = self._spline.at(times)
        result = np.tile(np.eye(4), (*values.shape[:2], 1, 1))
        stretch = values[..., 7:].reshape(*values.shape[:2], 3, 3)
        result[..., :3, :3] = rotation.from_quaternion(values[..., 3:7]) @ stretch
        result[..., :3, 3] = values[..., :3] + moved[:, None]
        return result


def _numbers(poses: np.ndarray) -> np.ndarray:
    """Positions, quaternions and stretches (T, J, 16) of world transforms (T, J, 4, 4)."""
    turns, stretch = rotation.polar(poses[..., :3, :3])
    quaternions = rotation.continuous(rotation.to_quaternion(turns))
    return np.concatenate([poses[..., :3, 3], quaternions, stretch.reshape(*poses.shape[:2], 9)], axis=-1)
