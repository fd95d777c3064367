# SPDX-License-Identifier: Apache-2.0
"""How strands bend from edge to edge, seen in axes that follow them without twist."""

import numpy as np


def bends(directions: np.ndarray) -> np.ndarray:
    """Bend vectors sin(angle / 2) n (..., E - 1, 3) between unit edges (..., E, 3).

    n is the axis of the smallest rotation from the first edge to the second. The axes start as the canonical ones at the root,
    whose first edge is clamped, and turn from edge to edge by these rotations. So a part of a strand that only turns as a
    whole keeps its bends.
    """
    edges = directions.reshape(-1, *directions.shape[-2:])
    count = edges.shape[1] - 1
    result = np.empty((len(edges), count, 3))
    axes = np.broadcast_to(np.eye(3), (len(edges), 3, 3)).copy()
    for i in range(count):
        a, b = edges[:, i], edges[:, i + 1]
        # An edge folded straight back has no smallest rotation and gets a finite one.
        one_plus_cos = np.maximum(1.0 + (a * b).sum(-1, keepdims=True), 1e-6)
        bend = np.cross(a, b) / np.sqrt(2.0 * one_plus_cos)
        result[:, i] = np.einsum("sji,sj->si", axes, bend)
        axes = np.einsum("sij,sjk->sik", _rotation(bend, np.sqrt(0.5 * one_plus_cos)), axes)
    return result.reshape(*directions.shape[:-2], count, 3)


def _rotation(vector: np.ndarray, scalar: np.ndarray) -> np.ndarray:
    """(S, 3, 3) rotation matrices of quaternions with imaginary part (S, 3) and real part (S, 1)."""
    norm = np.sqrt((vector**2).sum(-1, keepdims=True) + scalar**2)
    x, y, z = np.moveaxis(vector / norm, -1, 0)
    w = (scalar / norm)[:, 0]
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
