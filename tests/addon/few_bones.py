# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig of six bones, Z up, for tests of the add-on without Blender."""

import numpy as np

BONES = ("hips", "spine", "neck", "head", "upper_arm.L", "upper_arm.R")
PARENTS = np.array([-1, 0, 1, 2, 1, 1])
PLACES = np.array([[0, 0, 1], [0, 0, 1.2], [0, 0, 1.5], [0, 0, 1.6], [0.2, 0, 1.4], [-0.2, 0, 1.4]])


def rest() -> np.ndarray:
    """Transforms (6, 4, 4) of the bones at rest."""
    found = np.tile(np.eye(4), (6, 1, 1))
    found[:, :3, 3] = PLACES
    return found
