# SPDX-License-Identifier: Apache-2.0
"""The path of a few joints through a clip, smooth between its samples and defined before and after it."""

import numpy as np

from neuralocks_core import rotation
from neuralocks_core.character import Character
from neuralocks_core.motion import Clip


class Track:
    """Where a character's head is, and how some of its joints are turned, at any time.

    Joint motion between samples comes from a C2 spline through the clip, so that a 24 fps shot has the accelerations of
    the motion and not those of its polyline. Before the clip the head goes on with its first velocity and does not
    turn; a loop is continued on both sides.

    Args:
        character: whose motion it is.
        clip: without cuts.
        joints: indices of the joints (n,), whose rotations are wanted relative to the bind pose.
    """

    def __init__(self, character: Character, clip: Clip, joints: list[int]):
        # Here, because it takes as long to import as all else that a runtime needs.
        from scipy.interpolate import CubicSpline

        times, poses = extended(clip)
        quaternions = rotation.continuous(rotation.to_quaternion(character.relative_rotations(poses, joints)))
        values = np.concatenate([poses[:, character.head, :3, 3], quaternions.reshape(len(times), -1)], axis=1)
        self._clip, self._start, self._end = clip, times[0], times[-1]
        self._drift = clip.joints[-1, character.head, :3, 3] - clip.joints[0, character.head, :3, 3]
        if len(times) == 1:
            self._spline = lambda t: np.broadcast_to(values[0], (len(t), values.shape[1])).copy()
            self._speeds = np.zeros((2, 3))
        else:
            self._spline = CubicSpline(times, values, bc_type="natural")
            self._speeds = self._spline(times[[0, -1]], 1)[:, :3]

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Head positions (m, 3) [m] and rotations (m, n, 3, 3) of the joints at times (m,) [s]."""
        if self._clip.loop:
            base = self._clip.wrapped(times)
            laps = np.round((times - base) / max(self._clip.end - self._clip.start, 1e-9))
            values = self._spline(base)
            position = values[:, :3] + laps[:, None] * self._drift
        else:
            base = np.clip(times, self._start, self._end)
            values = self._spline(base)
            outside = times - base
            position = values[:, :3] + outside[:, None] * np.where(
                outside[:, None] < 0, self._speeds[0], self._speeds[1]
            )
        return position, rotation.from_quaternion(values[:, 3:].reshape(len(times), -1, 4))


def extended(clip: Clip) -> tuple[np.ndarray, np.ndarray]:
    """Sample times and transforms for the spline; a loop is continued a little on both sides so that its seam is
    smooth.
    """
    if not clip.loop or len(clip.times) < 3:
        return clip.times, clip.joints
    pad = min(len(clip.times) - 1, 8)
    period = clip.end - clip.start
    drift = np.zeros((clip.joints.shape[1], 4, 4))
    drift[:, :3, 3] = clip.joints[-1, :, :3, 3] - clip.joints[0, :, :3, 3]
    times = np.concatenate([clip.times[-1 - pad : -1] - period, clip.times, clip.times[1 : 1 + pad] + period])
    return times, np.concatenate([clip.joints[-1 - pad : -1] - drift, clip.joints, clip.joints[1 : 1 + pad] + drift])
