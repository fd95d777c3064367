# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones and armatures that are hidden by a scale of zero, as props are, or mirrored by a negative scale."""

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import flat, volumes

from .rig import RigArrays

NONE, HIDDEN = 1e-6, 1e-4
"""A scale below the first counts as zero, since Blender has single precision; what it hides gets the second instead."""


def unhidden(joints: np.ndarray, rig: RigArrays, needed: set[int], frames: np.ndarray) -> np.ndarray:
    """Joints (T, J, 4, 4), none flat or mirrored. A prop hidden by a scale of zero becomes HIDDEN times as large, and turns as its
    parent does. Mirrored joints get their first axis reversed.

    Args:
        joints: over time.
        rig: whose they are.
        needed: joints that hair needs, with those above them; they must be neither flat nor mirrored.
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
    """Refuse an armature that is scaled to zero, or mirrored, in some frames: then all its bones are, and none is to blame.

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
        (
            "is mirrored (negative scale)",
            volumes(linear) < 0,
            "apply its scale (Ctrl A in Object Mode), or its parent's if that is negative",
        ),
    ):
        if wrong.any():
            raise NeuralocksError(
                f"{name}: it {fact} in frame {frames[wrong.argmax()]:g}, and its hair with it; {remedy}"
            )


def _check(wrong: np.ndarray, needed: set[int], what: str, rig: RigArrays, frames: np.ndarray) -> None:
    """Refuse a needed joint that is `wrong` (T, J)."""
    for joint in np.flatnonzero(wrong.any(axis=0)):
        if joint in needed:
            raise NeuralocksError(
                f"{rig.name}: bone '{rig.bones[joint]}' has {what} in frame {frames[wrong[:, joint]][0]:g}, and hair is moved "
                "by it; give it a scale above zero"
            )
