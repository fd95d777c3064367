# SPDX-License-Identifier: GPL-3.0-or-later
"""Which joint an object moves with, found from its motion."""

from collections.abc import Callable, Sequence

import numpy as np

from neuralocks_core.rotation import transformed

from .motion import KEPT_TO, TOLERANCE

FAR = 200.0
"""Up to so many units from the origin, what counts as no motion grows with the distance; a person in centimetres is as large."""
ROUNDED = 16 * KEPT_TO
"""Beyond that, it grows with how Blender's single precision rounds places there alone."""


def on_joint(places: np.ndarray, objects: np.ndarray, joints: np.ndarray, bind: np.ndarray) -> np.ndarray | None:
    """The place (4, 4) in the bind pose of something that goes with a joint throughout, by whatever means; None where its
    motion does not say so.

    Args:
        places, objects, joints: world transforms (T, 4, 4) of it, of the armature object and of the joint.
        bind: of the joint in the bind pose (4, 4).
    """
    if _still(places, objects) or not _still(places, joints):
        return None
    return bind @ np.linalg.inv(joints[0]) @ places[0]


def carrier_below(
    places: np.ndarray, heads: np.ndarray, below: Sequence[int], moved: Callable[[int], np.ndarray]
) -> int | None:
    """The joint below the head that something goes with which does not go with the head: the jaw of a beard; None where there
    is none.

    Args:
        places, heads: world transforms (T, 4, 4) of it and of the head.
        below: joints below the head, parents first.
        moved: gives a joint's world transforms (T, 4, 4).
    """
    if _still(places, heads):
        return None
    for joint in below:
        joints = moved(joint)
        if np.linalg.det(joints).all() and _still(places, joints):
            return int(joint)
    return None


def strays(path: np.ndarray, carriers: Sequence[np.ndarray]) -> float:
    """How far a path (T, 3) leads, at most, from where that of some carriers would take its first point which it follows
    most closely; each is world transforms (T, 4, 4).
    """
    able = [carrier for carrier in carriers if np.linalg.det(carrier[0])]  # not those hidden by a scale of zero
    firsts = [transformed(path[0], np.linalg.inv(carrier[0])) for carrier in able]
    off = [path - (way[:, :3, :3] @ first + way[:, :3, 3]) for way, first in zip(able, firsts)]
    return min((float(np.linalg.norm(each, axis=-1).max()) for each in off), default=0.0)


def _still(places: np.ndarray, carriers: np.ndarray) -> bool:
    """Whether something (T, 4, 4) does not move against what carries it (T, 4, 4)."""
    relative, far = np.linalg.inv(carriers) @ places, float(np.abs(places).max())
    return bool(np.ptp(relative, axis=0).max() <= TOLERANCE * max(1.0, min(far, FAR)) + ROUNDED * far)
