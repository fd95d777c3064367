# SPDX-License-Identifier: Apache-2.0
"""The path of a few joints through a clip, smooth between its samples and defined before and after it."""

import numpy as np

from neuralocks_core import rotation
from neuralocks_core.boundary.clip_spline import ClipSpline
from neuralocks_core.character import Character
from neuralocks_core.motion import Clip


class Track:
    """Position of a character's head, and rotations of some joints, at any time: between the samples of a clip and outside them
    as in `ClipSpline`.

    Args:
        character: whose motion it is.
        clip: without cuts.
        joints: indices of the joints (n,), whose rotations are wanted relative to the bind pose.
    """

    def __init__(self, character: Character, clip: Clip, joints: list[int]):
        def values(poses):
            quaternions = rotation.continuous(rotation.to_quaternion(character.relative_rotations(poses, joints)))
            return np.concatenate([character.head_place(poses), quaternions.reshape(len(poses), -1)], axis=1)

        self._spline = ClipSpline(clip, character.head_place, values)

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Head positions (m, 3) [m] and rotations (m, n, 3, 3) of the joints at times (m,) [s]."""
        values, moved = self._spline.at(times)
        return values[:, :3] + moved, rotation.from_quaternion(values[:, 3:].reshape(len(times), -1, 4))
