# SPDX-License-Identifier: GPL-3.0-or-later
"""Which joint an object moves with, found from its motion."""

from collections.abc import Callable, Sequence

import numpy as np

from neuralocks_core.rotation import strayed

from .motion import KEPT_TO, TOLERANCE

FAR = 200.0
"""Up to this many units from the origin, the tolerance for no motion grows with the distance; a person in centimetres is this
large."""
ROUNDED = 16 * KEPT_TO
"""Beyond that, it only grows with the rounding of places in Blender's single precision."""


def on_joint(places: np.ndarray, objects: np.ndarray, joints: np.ndarray, bind: np.ndarray) -> np.ndarray | None:
    """The place (4, 4) in the bind pose of something that moves with a joint throughout, by whatever means; None if it does not.

    Args:
        places, objects, joints: world transforms (T, 4, 4) of it, of the armature object and of the joint.
        bind: of the joint in the bind pose (4, 4).
    """
    if _still(places, objects) or not _still(places, joints):
        return None
    return in_first(places, joints, bind)


def in_first(places: np.ndarray, joints: np.ndarray, bind: np.ndarray) -> np.ndarray:
    """The place (4, 4) in the bind pose of something that stands to a joint as in the first of all frames; arguments as for `on_joint`."""
    return bind @ np.linalg.inv(joints[0]) @ places[0]


def carrier_below(
    places: np.ndarray, heads: np.ndarray, below: Sequence[int], moved: Callable[[int], np.ndarray]
) -> int | None:
    """The joint below the head that something moves with if it does not move with the head, such as a beard with the jaw; None if
    there is none.

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
    """The largest distance of a path (T, 3) from where the carrier that it follows most closely would take its first point;
    carriers are world transforms (T, 4, 4).
    """
    off = [strayed(path, carrier) for carrier in carriers]
    return min((each for each in off if each < np.inf), default=0.0)  # without those hidden by a scale of zero


def _still(places: np.ndarray, carriers: np.ndarray) -> bool:
    """Whether something (T, 4, 4) does not move relative to what carries it (T, 4, 4)."""
    relative, far = np.linalg.inv(carriers) @ places, float(np.abs(places).max())
    return bool(np.ptp(relative, axis=0).max() <= TOLERANCE * max(1.0, min(far, FAR)) + ROUNDED * far)
