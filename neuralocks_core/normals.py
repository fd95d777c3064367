# SPDX-License-Identifier: Apache-2.0
"""Normals of a mesh at its vertices."""

import numpy as np


def vertex_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals (V, 3) of points (V, 3), outward as the triangles (F, 3) are by the right-hand rule.

    Each is the mean of the faces around, weighted by their area; zero where there is none.
    """
    a, b, c = (np.asarray(points, float)[corner] for corner in triangles.T)
    face, corners = np.cross(b - a, c - a), triangles.T.ravel()
    total = np.stack([np.bincount(corners, np.tile(part, 3), len(points)) for part in face.T], axis=1)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
