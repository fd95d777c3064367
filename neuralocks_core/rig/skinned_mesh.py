# SPDX-License-Identifier: Apache-2.0
"""A skinned mesh of a rig, and what drives it."""

from dataclasses import dataclass

import numpy as np

LEAST_WEIGHT = 1e-3
"""Skin weight below which a joint does not drive a vertex."""


@dataclass(frozen=True, eq=False)
class SkinnedMesh:
    """One skinned mesh of a rig.

    Attributes:
        points: bind pose, world space, (V, 3) [m].
        triangles: (F, 3) int.
        joint_indices: indices in the skeleton, (V, I) int.
        joint_weights: (V, I), each row sums to one.
    """

    points: np.ndarray
    triangles: np.ndarray
    joint_indices: np.ndarray
    joint_weights: np.ndarray

    def weight_on(self, joints: np.ndarray) -> np.ndarray:
        """Sum of each vertex's weights (V,) on the joints of a mask (J,)."""
        return np.sum(self.joint_weights * joints[self.joint_indices], axis=1)

    def driven_by(self, joint_count: int) -> np.ndarray:
        """Which joints (J,) drive any of its vertices."""
        used = np.zeros(joint_count, bool)
        used[self.joint_indices[self.joint_weights > LEAST_WEIGHT]] = True
        return used
