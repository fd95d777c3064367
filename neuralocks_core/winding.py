# SPDX-License-Identifier: Apache-2.0
"""Which side of a mesh is out: files exist whose every triangle faces inward, and hair would be pushed into such a body."""

import numpy as np

INSIDE_OUT = -0.3
"""Of the volumes that triangles span with the middle of the mesh, sum over sum of sizes: 1 for a ball, 0.5 for a person
with arms spread, near 0 for hair cards and cloth, whose sides say nothing. Below this the mesh is inside out."""


def inside_out(points: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether the triangles (F, 3) of a mesh's points (V, 3) face inward."""
    if not len(triangles):
        return False
    around = np.asarray(points, float)
    around = around - around[triangles].mean(axis=(0, 1))
    a, b, c = (around[triangles[:, corner]] for corner in range(3))
    volumes = np.einsum("fi,fi->f", a, np.cross(b, c))
    return bool(volumes.sum() < INSIDE_OUT * np.abs(volumes).sum())
