# SPDX-License-Identifier: Apache-2.0
"""Hair does not stretch: every edge of a moved strand gets its length at rest back."""

from __future__ import annotations

import numpy as np

from neuralocks_core.sums import dot

TINY = np.float32(1e-24)
"""[m^2] Keeps zero-length edges finite, and is too small to change others."""


def keep_lengths(points: np.ndarray, moved: np.ndarray, smooth: bool) -> np.ndarray:
    """Displacements (N, V, 3) float32 [m] with which no edge is longer or shorter than at rest.

    From the root on, each edge about keeps the direction it was moved to, and the hair its path. What does not move stays the
    same, bit for bit, and a strand depends only on itself.

    Args:
        points: (N, V, 3) float32 [m] vertices at rest.
        moved: (N, V, 3) float32 [m] how far each was moved.
        smooth: whether edges point along the strands' paths; a coil's point all around.
    """
    before = np.diff(points, axis=1)
    edges, lengths = np.diff(moved, axis=1) + before, dot(before, before)
    squared = dot(edges, edges) + TINY
    if smooth:
        # Restoring lengths alone would make each vertex drift from where it was moved to, by the sum of (scale - 1) edge. Drift
        # along the hair does not matter, but sideways drift takes the hair off its path, even into the head: each edge is turned
        # back by it. If `along` times its own edge is the part of a vertex's drift along the hair, an edge without the sideways
        # drift of its ends is, apart from its length, edge_i (1 + along_i) - edge_(i-1) along_(i-1).
        scale = np.sqrt(lengths / squared) - np.float32(1.0)
        drift = np.cumsum(edges * scale[..., None], axis=1)
        other = edges * (dot(drift, edges) / squared)[..., None]
        edges = edges + other
        edges[:, 1:] -= other[:, :-1]
    edges = edges * np.sqrt(lengths / (dot(edges, edges) + TINY))[..., None] - before
    return np.cumsum(np.concatenate([moved[:, :1], edges], axis=1), axis=1)
