# SPDX-License-Identifier: Apache-2.0
"""A clip's joints as a C2 spline through its samples, and their motion before and after them."""

from collections.abc import Callable

import numpy as np

from neuralocks_core.motion import Clip


class ClipSpline:
    """Numbers computed from a clip's poses, at any time.

    Between samples, accelerations are those of the motion and not of its polyline, which a 24 fps shot needs. Before the clip,
    the pose is held while the character moves with the head's first velocity: hair must not begin with a blow. After the clip,
    all joints stand still, as a stage shows it. A loop continues on both sides, and a character that walks in it moves ahead.

    Args:
        clip: without cuts.
        place: gives the head's position (T, 3) [m] for world transforms (T, J, 4, 4).
        values: gives the numbers (T, ...) for world transforms (T, J, 4, 4); they are blended linearly.
    """

    def __init__(self, clip: Clip, place: Callable, values: Callable[[np.ndarray], np.ndarray]):
        # Imported here, because it takes as long as all other imports of a runtime.
        from scipy.interpolate import CubicSpline

        times, poses = _extended(clip)
        numbers = values(poses)
        self._clip = clip
        first, last = place(clip.joints[[0, -1]])
        self._drift = last - first
        if len(times) == 1:
            self._spline = lambda t: numbers.repeat(len(t), axis=0)
            self._speed = np.zeros(3)
        else:
            self._spline = CubicSpline(times, numbers, bc_type="natural")
            self._speed = CubicSpline(times, place(poses), bc_type="natural")(times[0], 1)

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The numbers (n, ...) at times (n,) [s], and the offset (n, 3) [m] to add to all joints."""
        clip, base = self._clip, self._clip.wrapped(times)
        beyond = (times - base)[:, None]
        if clip.loop:
            moved = np.round(beyond / max(clip.period, 1e-9)) * self._drift
        else:
            moved = np.minimum(beyond, 0) * self._speed
        return self._spline(base), moved


def _extended(clip: Clip) -> tuple[np.ndarray, np.ndarray]:
    """Sample times and transforms for the spline; a loop is continued a little on both sides so that its seam is smooth."""
    if not clip.loop or len(clip.times) < 3:
        return clip.times, clip.joints
    pad = min(len(clip.times) - 1, 8)
    period = clip.period
    drift = np.zeros((clip.joints.shape[1], 4, 4))
    drift[:, :3, 3] = clip.joints[-1, :, :3, 3] - clip.joints[0, :, :3, 3]
    times = np.concatenate([clip.times[-1 - pad : -1] - period, clip.times, clip.times[1 : 1 + pad] + period])
    return times, np.concatenate([clip.joints[-1 - pad : -1] - drift, clip.joints, clip.joints[1 : 1 + pad] + drift])
