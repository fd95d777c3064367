# SPDX-License-Identifier: Apache-2.0
"""Turns detail off the network's polyline, such as the loops of a coil, with the segments of the polyline."""

from __future__ import annotations

import numpy as np

from neuralocks_core.rotation import cross
from neuralocks_core.sums import dot


def turned(
    edges: np.ndarray, displacement: np.ndarray, segment: np.ndarray, share: np.ndarray, beside: np.ndarray
) -> np.ndarray:
    """Displacement of own vertices: that of the polyline at their place, plus their turned offset from it.

    The offset is turned by the smallest rotations that take the polyline's rest segments to the deformed ones.

    Args:
        edges: (N, K - 1, 3) float32 [m], segments at rest.
        displacement: (N, K, 3) float32 [m].
        segment: (N, V) of the segment each own vertex lies at.
        share: (N, V) float32 of the distance to its end.
        beside: (N, V, 3) float32 [m] from the polyline to the own vertex, at rest.

    Returns:
        (N, V, 3) float32 [m].
    """
    strand, segment, share = np.arange(len(edges))[:, None], segment.astype(int), share[..., None]
    steps = np.diff(displacement, axis=1)
    moved = displacement[strand, segment] + share * steps[strand, segment]
    turns = _turns(edges, steps)
    turn = turns[strand, segment]
    turn += share * (turns[strand, segment + 1] - turn)
    # A quaternion of any length turns r by 2 (w q x r + q x (q x r)) / |q|^2: not at all if q is zero.
    once = cross(turn[..., :3], beside)
    twice = cross(turn[..., :3], once)
    twice += once * turn[..., 3:]
    twice *= (np.float32(2.0) / np.maximum(dot(turn, turn), np.float32(1e-12)))[..., None]
    return moved + twice


def _turns(edges: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Smallest rotations of the segments at rest to the deformed ones, blended at each vertex.

    They are blended so that detail off the polyline is not torn where two segments meet.

    Args:
        edges: (N, K - 1, 3) [m], segments at rest.
        steps: (N, K - 1, 3) [m], difference of displacement along each.

    Returns:
        (N, K, 4) float32 quaternions x y z w, not of unit length, x y z exactly zero where nothing moved.
    """
    now = edges + steps
    # Halfway between no turn and twice the turn; a segment turned back onto itself has no smallest rotation.
    real = np.sqrt(dot(edges, edges) * dot(now, now)) + dot(edges, now)
    segment = np.concatenate([cross(edges, now), real[..., None]], axis=-1)
    segment /= np.sqrt(np.maximum(dot(segment, segment), np.float32(1e-30)))[..., None]
    middle = (segment[:, :-1] + segment[:, 1:]) * np.float32(0.5)
    return np.concatenate([segment[:, :1], middle, segment[:, -1:]], axis=1)
