# SPDX-License-Identifier: Apache-2.0
"""Which way is up in a bind pose: what of the turn of a character's parents is axes, and what is pose."""

import numpy as np
from scipy.spatial.transform import Rotation

from neuralocks_core.humanoid import Humanoid
from neuralocks_core.rotation import rotation_part

UPRIGHT = 45.0
"""A character whose legs, or trunk, are less than this off the vertical [degrees] stands."""
MUCH = 10.0
"""If it stands straighter by more than this [degrees] in axes that are turned by any angle, it was built in these."""
FEET = ("left_foot", "right_foot", "left_lower_leg", "right_lower_leg")


def standing(placed: np.ndarray, joints: np.ndarray, humanoid: Humanoid, up: np.ndarray) -> np.ndarray:
    """The turn and scale that a character's parents give it in its bind pose.

    Quarter turns are what an exporter did to the axes: the nearest are taken in which the character stands. By other
    angles parents turn a character as a joint would: one that leans with its parent has the bind pose of one that stands.

    Args:
        placed: their turn and scale (3, 3) at rest.
        joints: places (J, 3) in the bind pose, without them.
        humanoid: which of these are head, hips and feet.
        up: the direction (3,) that is up where the parents are.

    Returns:
        (3, 3); `placed` itself, bit for bit, where that turns by quarters.
    """
    here = rotation_part(placed)
    feet = [joints[humanoid[name]] for name in FEET if name in humanoid]
    head, hips = (joints[humanoid.get(name, 0)] for name in ("head", "hips"))
    # Legs are upright on two feet and on four; a trunk without legs may be either's.
    axis = (hips if "hips" in humanoid else head) - np.mean(feet, axis=0) if feet else head - hips
    length = np.linalg.norm(axis)

    def tilt(turn: np.ndarray) -> float:
        cosine = up @ turn @ axis / length if length else 1.0
        return np.degrees(np.arccos(np.clip(cosine, -1, 1)))

    quarters = sorted(Rotation.create_group("O").as_matrix().round(), key=lambda turn: -round(np.sum(turn * here), 9))
    if not feet:  # without legs, what goes on four of them is not told from what lies down
        quarters = [quarters[0], np.eye(3)]
    turn = next((turn for turn in quarters if tilt(turn) < UPRIGHT), here)
    if tilt(here) < tilt(turn) - MUCH or np.abs(turn - here).max() < 1e-6:
        return placed
    return turn @ here.T @ placed
