# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones and armatures that are hidden by a scale of zero, as props are, or mirrored by a negative scale."""

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import flat, volumes

from .rig import RigArrays

NONE, HIDDEN = 1e-6, 1e-4
"""A scale below the first is none, for Blender has single precision; what is hidden by that has the second instead."""


def unhidden(joints: np.ndarray, rig: RigArrays, needed: set[int], frames: np.ndarray) -> np.ndarray:
    """Joints (T, J, 4, 4) of which none is flat or mirrored: a prop is hidden by a scale of zero; it becomes HIDDEN times as
    large, and turns as its parent does. What is mirrored has its first axis turned round.

    Args:
        joints: over time.
        rig: whose they are.
        needed: joints that hair needs, with those that they hang from; these may be neither.
        frames: (T,), for messages.

    Raises:
        NeuralocksError: one of them is.
    """
    hidden = flat(joints[..., :3, :3], NONE)
    mirrored = (volumes(joints[..., :3, :3]) < 0) & ~hidden
    if not (hidden.any() or mirrored.any()):
        return joints
    _check(mirrored, needed, "a negative scale", rig, frames)
    _check(hidden, needed | set(np.flatnonzero(rig.parents < 0)), "zero scale", rig, frames)
    result = joints.copy()
    result[mirrored, :3, 0] *= -1
    for joint in np.flatnonzero(hidden.any(axis=0)):  # parents come first
        rows = np.flatnonzero(hidden[:, joint])
        above = result[rows, rig.parents[joint], :3, :3]
        size = np.cbrt(np.abs(np.linalg.det(above)))[:, None, None]
        result[rows, joint, :3, :3] = above * np.where(size > HIDDEN, HIDDEN / size, 1.0)
    return result


def check_placed(places: np.ndarray, frames: np.ndarray, name: str) -> None:
    """Refuse an armature that is scaled to nothing, or mirrored in some frames: all its bones are then, and none of them is to blame.

    Args:
        places: world transforms (T, 4, 4) of the armature.
        frames: (T,), for the message.
        name: the armature's.

    Raises:
        NeuralocksError: it is.
    """
    linear = places[:, :3, :3]
    for fact, wrong, remedy in (
        ("has zero scale", flat(linear, NONE), "give it and its parents a scale above zero"),
        ("is mirrored (negative scale)", volumes(linear) < 0, "apply its scale (Ctrl A in Object Mode)"),
    ):
        if wrong.any():
            raise NeuralocksError(
                f"{name}: it {fact} in frame {frames[wrong.argmax()]:g}, and its hair with it; {remedy}"
            )


def _check(wrong: np.ndarray, needed: set[int], what: str, rig: RigArrays, frames: np.ndarray) -> None:
    """Refuse what is `wrong` (T, J) with a joint that is needed."""
    for joint in np.flatnonzero(wrong.any(axis=0)):
        if joint in needed:
            raise NeuralocksError(
                f"{rig.name}: bone '{rig.bones[joint]}' has {what} in frame {frames[wrong[:, joint]][0]:g}, and hair is moved "
                "by it; give it a scale above zero"
            )
