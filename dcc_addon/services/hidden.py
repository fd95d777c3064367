# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that are hidden by a scale of zero, as props are."""

import numpy as np

from neuralocks_core.errors import NeuralocksError

from .rig import RigArrays

FLAT, HIDDEN = 1e-6, 1e-4
"""A scale below the first is none; what is hidden by that has the second instead."""


def unhidden(joints: np.ndarray, rig: RigArrays, needed: set[int], frames: np.ndarray) -> np.ndarray:
    """Joints (T, J, 4, 4) of which none is flat: a prop is hidden by a scale of zero; it becomes HIDDEN times as large, and
    turns as its parent does.

    Args:
        joints: over time.
        rig: whose they are.
        needed: joints that hair needs, with those that they hang from; these may not be flat.
        frames: (T,), for messages.

    Raises:
        NeuralocksError: one of them is.
    """
    flat = np.linalg.norm(joints[..., :3, :3], axis=-2).min(axis=-1) < FLAT
    if not flat.any():
        return joints
    result = joints.copy()
    for joint in np.flatnonzero(flat.any(axis=0)):  # parents come first
        rows = np.flatnonzero(flat[:, joint])
        if joint in needed or rig.parents[joint] < 0:
            raise NeuralocksError(
                f"{rig.name}: bone '{rig.bones[joint]}' has zero scale in frame {frames[rows[0]]:g}, and hair is moved by it; "
                "give it a scale above zero"
            )
        above = result[rows, rig.parents[joint], :3, :3]
        size = np.cbrt(np.abs(np.linalg.det(above)))[:, None, None]
        result[rows, joint, :3, :3] = above * np.where(size > HIDDEN, HIDDEN / size, 1.0)
    return result
