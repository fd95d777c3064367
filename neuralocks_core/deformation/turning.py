# SPDX-License-Identifier: Apache-2.0
"""Carrying what lies off the network's polyline, such as the turns of a coil, by the turns of its segments."""

from __future__ import annotations

import numpy as np


class Coils:
    """Own vertices of strands that are finer than the network's vertices.

    Args:
        rest: (N, K, 3) [m], the network's vertices.
        own: (P, 3) [m] own vertices, same axes.
        strand: (P,) which strand each belongs to.
        place: (P,) in [0, K - 1], position along it in network segments.
        fine: (N,) bool, which strands are meant.
    """

    def __init__(self, rest, own, strand, place, fine) -> None:
        vertices = rest.shape[1]
        chosen = fine[strand]
        own, strand, place = own[chosen], (np.cumsum(fine) - 1)[strand[chosen]], place[chosen]
        self._rest = np.ascontiguousarray(rest[fine])
        # How many of them come before a strand of all N, and before each of their own vertices.
        self._before = np.concatenate([[0], np.cumsum(fine)])
        self._ends = np.searchsorted(strand, np.arange(len(self._rest) + 1))
        segment = np.clip(place.astype(np.int32), 0, vertices - 2)
        share = np.clip(place - segment, 0.0, 1.0)[:, None]
        flat, at = self._rest.reshape(-1, 3).astype(np.float64), strand * vertices + segment
        self._residual = (own - (flat[at] * (1.0 - share) + flat[at + 1] * share)).astype(np.float32)
        self._share, self._segment = share.astype(np.float32), at.astype(np.int32)

    def moved(self, displacement: np.ndarray, start: int) -> np.ndarray:
        """Displacement (P', 3) [m] of their own vertices.

        Args:
            displacement: (n, K, 3) [m] of the network's vertices of the next n of them.
            start: the strand of all N from which on they are counted.
        """
        first = self._before[start]
        last = first + len(displacement)
        own = slice(self._ends[first], self._ends[last])
        segment = self._segment[own] - np.int32(first * displacement.shape[1])
        return turned(self._rest[first:last], displacement, segment, self._share[own], self._residual[own])


def turned(
    rest: np.ndarray, displacement: np.ndarray, segment: np.ndarray, weight: np.ndarray, residual: np.ndarray
) -> np.ndarray:
    """Displacement of own vertices: that of the polyline at their place, and their distance from it turned.

    It is turned by the smallest rotations that take the polyline's rest segments to the deformed ones.

    Args:
        rest, displacement: (N, K, 3) float32 [m].
        segment: (P,) first vertex of the segment each own vertex lies at, counted through all strands.
        weight: (P, 1) float32 share of the way to the next vertex.
        residual: (P, 3) float32 [m] from the polyline to the own vertex, at rest.

    Returns:
        (P, 3) float32 [m].
    """
    steps = np.zeros_like(displacement)
    np.subtract(displacement[:, 1:], displacement[:, :-1], out=steps[:, :-1])
    moved = displacement.reshape(-1, 3).take(segment, axis=0)
    moved += weight * steps.reshape(-1, 3).take(segment, axis=0)
    turns = _turns(rest, steps).reshape(-1, 4)
    turn = turns.take(segment, axis=0)
    turn += weight * (turns.take(segment + 1, axis=0) - turn)
    x, y, z, w = np.ascontiguousarray(turn.T)
    a, b, c = np.ascontiguousarray(residual.T)
    # A quaternion of any length turns r by 2 (w q x r + q x (q x r)) / |q|^2: nothing where q is zero.
    once = y * c - z * b, z * a - x * c, x * b - y * a
    scale = np.float32(2.0) / np.maximum(x * x + y * y + z * z + w * w, np.float32(1e-12))
    moved[:, 0] += scale * (w * once[0] + y * once[2] - z * once[1])
    moved[:, 1] += scale * (w * once[1] + z * once[0] - x * once[2])
    moved[:, 2] += scale * (w * once[2] + x * once[1] - y * once[0])
    return moved


def _turns(rest: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Smallest rotations of the segments at rest to the deformed ones, blended at each vertex.

    Blended, so that what lies off the polyline is not torn where two segments meet.

    Args:
        rest: (N, K, 3) [m].
        steps: (N, K, 3) [m], difference of displacement along each segment (last row unused).

    Returns:
        (N, K, 4) float32 quaternions x y z w, not of unit length, x y z exactly zero where nothing moved.
    """
    edges = rest[:, 1:] - rest[:, :-1]
    # One array a coordinate: three to a row leave a processor's vectors mostly empty.
    a, b, c = np.ascontiguousarray(edges.transpose(2, 0, 1))
    p, q, r = np.ascontiguousarray((edges + steps[:, :-1]).transpose(2, 0, 1))
    lengths = np.sqrt((a * a + b * b + c * c) * (p * p + q * q + r * r))
    # Half way between no turn and twice the turn; a segment turned back onto itself has no smallest rotation.
    segment = np.empty((4, *a.shape), np.float32)
    segment[0], segment[1], segment[2] = b * r - c * q, c * p - a * r, a * q - b * p
    segment[3] = lengths + (a * p + b * q + c * r)
    segment /= np.sqrt(np.maximum((segment * segment).sum(axis=0), np.float32(1e-30)))
    turns = np.empty((*rest.shape[:2], 4), np.float32)
    turns[:, 0], turns[:, -1] = segment[:, :, 0].T, segment[:, :, -1].T
    middle = segment[:, :, :-1] + segment[:, :, 1:]
    middle *= np.float32(0.5)
    turns[:, 1:-1] = middle.transpose(1, 2, 0)
    return turns
