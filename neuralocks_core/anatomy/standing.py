# SPDX-License-Identifier: Apache-2.0
"""Which way is up in a bind pose: how much of the parents' turn is axes, how much is pose, and whether a character lies down."""

import numpy as np
from scipy.spatial.transform import Rotation

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.rotation import angle_between, rotation_part

SAME = 1e-6
"""Entries of rotations that differ by less are the same."""
STRAIGHTER = 45.0
"""If the nearest quarter turn leaves legs, or a trunk without legs, farther off the vertical than another one would, by more
than this [degrees], the nearest quarter turn that does not is used."""
ASKEW = 10.0
"""If legs and trunk are each closer to the vertical as they are than after any quarter turn, by more than this [degrees], the
character was built askew."""
NEAR = 30.0
"""If nothing tells which way is up, the nearest quarter turn is used if it is this close [degrees]."""
LIES = 60.0
"""A character whose legs and trunk are farther off the vertical than this [degrees] lies down."""
SHORT = 0.25
"""Legs shorter than this share of the trunk do not count: they were measured from a root on the floor, or by a control's joints."""
THIGHS = ("left_upper_leg", "right_upper_leg")
FEET = ("left_foot", "right_foot", "left_lower_leg", "right_lower_leg")


def standing(placed: np.ndarray, joints: np.ndarray, humanoid: Humanoid, up: np.ndarray) -> np.ndarray:
    """The turn and scale that a character's parents give it in its bind pose.

    Quarter turns are an exporter's conversion of axes: the nearest one is used, or, if the character would lie down after it,
    one after which it stands. By other angles, parents turn a character as a joint would: a character that leans with its
    parent has the same bind pose as one that stands.

    Args:
        placed: the parents' turn and scale (3, 3) at rest.
        joints: joint positions (J, 3) in the bind pose, without the parents.
        humanoid: which of these are head, hips, legs and feet.
        up: the direction (3,) that is up where the parents are.

    Returns:
        (3, 3); `placed` itself, bit for bit, if it turns by quarters or the character was built askew.
    """
    here = rotation_part(placed)
    if np.abs(here - np.eye(3)).max() < SAME:
        return placed
    legs, trunk = _axes(joints, humanoid)
    found = [axis for axis in (legs, trunk) if axis is not None]

    def tilt(turn: np.ndarray, axis: np.ndarray) -> float:
        return _tilt(turn @ axis, up)

    quarters = sorted(Rotation.create_group("O").as_matrix().round(), key=lambda turn: -round(np.sum(turn * here), 9))
    turn = quarters[0]
    if found:
        # Legs are upright on bipeds and quadrupeds; a trunk without legs may belong to either.
        others = quarters if legs is not None else [np.eye(3)]
        least = min(tilt(o, found[0]) for o in others) + STRAIGHTER
        if tilt(turn, found[0]) > least:
            turn = next(o for o in others if tilt(o, found[0]) <= least)
        if all(tilt(here, axis) < tilt(turn, axis) - ASKEW for axis in found):
            return placed
    elif np.degrees(angle_between(turn, here)) > NEAR:
        return placed
    return placed if np.abs(turn - here).max() < SAME else turn @ here.T @ placed


def lies(joints: np.ndarray, humanoid: Humanoid, up: np.ndarray) -> tuple[bool, bool]:
    """Whether a character lies down in its bind pose, and whether that is certain: without known legs it may be on all fours.

    Args:
        joints: joint positions (J, 3) in the bind pose.
        humanoid: which of these are head, hips, legs and feet.
        up: the direction (3,) that is up there.
    """
    legs, trunk = _axes(joints, humanoid)
    tilts = [_tilt(axis, up) for axis in (legs, trunk) if axis is not None]
    return bool(tilts) and min(tilts) > LIES, legs is not None and trunk is not None


def _tilt(axis: np.ndarray, up: np.ndarray) -> float:
    """Angle [degrees] between two directions (3,)."""
    return float(np.degrees(np.arccos(np.clip(up @ axis, -1, 1))))


def _axes(joints: np.ndarray, humanoid: Humanoid) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Directions (3,) from the feet to the upper ends of the legs and from the hips to the head; None if unknown."""
    feet, thighs = ([joints[humanoid[name]] for name in names if name in humanoid] for names in (FEET, THIGHS))
    head, hips = (joints[humanoid[name]] if name in humanoid else None for name in ("head", "hips"))
    # The hips, where the paths from head and legs meet, may be a root on the floor, below the feet.
    top = np.mean(thighs, axis=0) if thighs else hips
    legs = top - np.mean(feet, axis=0) if feet and top is not None else None
    trunk = head - hips if head is not None and hips is not None else None
    if legs is not None and trunk is not None and np.linalg.norm(legs) < SHORT * np.linalg.norm(trunk):
        legs = None
    return tuple(None if a is None or not np.linalg.norm(a) else a / np.linalg.norm(a) for a in (legs, trunk))
