# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's world (Z up, characters look along -Y, any unit) and the core's (metres, Y up, +Z)."""

import numpy as np

# The same rotation with which `usd.border.units` reads a Z-up stage: both ways give one result.
_TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def to_core(metres_per_unit: float = 1.0) -> np.ndarray:
    """Transform (4, 4) from Blender's world space to the core's; `metres_per_unit` is the scene's unit scale."""
    matrix = np.eye(4)
    matrix[:3, :3] = _TURN * metres_per_unit
    return matrix
