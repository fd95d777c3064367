# SPDX-License-Identifier: Apache-2.0
"""Turns detail off the network's polyline, such as the loops of a coil, with the segments of the polyline."""

from __future__ import annotations

import numpy as np


class Coils:
    """Own vertices of strands with detail finer than the network's vertices.

    Args:
        rest: (N, K, 3) [m], the network's vertices.
        own: (P, 3) [m] own vertices, same axes.
        strand: (P,) which strand each belongs to.
        place: (P,) in [0, K - 1], position along it in network segments.
        fine: (N,) bool, which strands have such detail.
    """

    def __init__(self, rest, own, strand, place, fine) -> None:
        vertices = rest.shape[1]
        chosen = fine[strand]
        own, strand, place = own[chosen], (np.cumsum(fine) - 1)[strand[chosen]], place[chosen]
        moving = rest[fine]
        self._edges = np.diff(moving, axis=1).transpose(2, 0, 1).copy()
        # How many fine strands come before each of all N, and how many own vertices before each fine strand.
        self._before = np.concatenate([[0], np.cumsum(fine)])
        self._ends = np.searchsorted(strand, np.arange(len(moving) + 1))
        segment = np.clip(place.astype(np.int32), 0, vertices - 2)
        share = np.clip(place - segment, 0.0, 1.0)[:, None]
        flat, at = moving.reshape(-1, 3).astype(np.float64), strand * vertices + segment
        self._residual = (own - (flat[at] * (1.0 - share) + flat[at + 1] * share)).T.astype(np.float32, order="C")
        self._share, self._segment = share[:, 0].astype(np.float32), at.astype(np.int32)

    def moved(self, displacement: np.ndarray, start: int) -> np.ndarray:
        """Displacement (3, P') [m] of the own vertices of fine strands.

        Args:
            displacement: (n, K, 3) [m] of the network's vertices, for the next n of all strands.
            start: the first of these, counted among all N.
        """
        first = self._before[start]
        last = first + len(displacement)
        own = slice(self._ends[first], self._ends[last])
        segment = self._segment[own] - np.int32(first * displacement.shape[1])
        return turned(self._edges[:, first:last], displacement, segment, self._share[own], self._residual[:, own])


def turned(
    edges: np.ndarray, displacement: np.ndarray, segment: np.ndarray, share: np.ndarray, residual: np.ndarray
) -> np.ndarray:
    """Displacement of own vertices: that of the polyline at their place, plus their turned offset from it.

    The offset is turned by the smallest rotations that take the polyline's rest segments to the deformed ones.

    Args:
        edges: (3, N, K - 1) float32 [m], segments at rest.
        displacement: (N, K, 3) float32 [m].
        segment: (P,) first vertex of the segment each own vertex lies at, counted through all strands.
        share: (P,) float32 of the distance to the next vertex.
        residual: (3, P) float32 [m] from the polyline to the own vertex, at rest.

    Returns:
        (3, P) float32 [m].
    """
    network = displacement.transpose(2, 0, 1).copy()
    steps = np.zeros_like(network)
    np.subtract(network[:, :, 1:], network[:, :, :-1], out=steps[:, :, :-1])
    moved = _at(network, segment)
    moved += share * _at(steps, segment)
    turns = _turns(edges, steps[:, :, :-1])
    turn = _at(turns, segment)
    turn += share * (_at(turns, segment + 1) - turn)
    # A quaternion of any length turns r by 2 (w q x r + q x (q x r)) / |q|^2: not at all if q is zero.
    once = _cross(turn[:3], residual)
    twice = _cross(turn[:3], once)
    once *= turn[3]
    twice += once
    twice *= np.float32(2.0) / np.maximum(_dot(turn, turn), np.float32(1e-12))
    moved += twice
    return moved


def _turns(edges: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Smallest rotations of the segments at rest to the deformed ones, blended at each vertex.

    They are blended so that detail off the polyline is not torn where two segments meet.

    Args:
        edges: (3, N, K - 1) [m], segments at rest.
        steps: (3, N, K - 1) [m], difference of displacement along each.

    Returns:
        (4, N, K) float32 quaternions x y z w, not of unit length, x y z exactly zero where nothing moved.
    """
    now = edges + steps
    lengths = np.sqrt(_dot(edges, edges) * _dot(now, now))
    # Halfway between no turn and twice the turn; a segment turned back onto itself has no smallest rotation.
    segment = np.empty((4, *lengths.shape), np.float32)
    segment[:3] = _cross(edges, now)
    np.add(lengths, _dot(edges, now), out=segment[3])
    segment /= np.sqrt(np.maximum(_dot(segment, segment), np.float32(1e-30)))
    turns = np.empty((*segment.shape[:2], segment.shape[2] + 1), np.float32)
    turns[:, :, 0], turns[:, :, -1] = segment[:, :, 0], segment[:, :, -1]
    middle = np.add(segment[:, :, :-1], segment[:, :, 1:], out=turns[:, :, 1:-1])
    middle *= np.float32(0.5)
    return turns


def _at(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Values (C, N, K) of vertices (P,), counted through all strands: (C, P)."""
    return values.reshape(len(values), -1).take(places, axis=1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors (3, ...), coordinates first: x y z x y of both, so that three products are one call. Usually only
    a few strands of a groom are this fine, so the number of calls determines the cost.
    """
    a, b = np.concatenate([a, a[:2]]), np.concatenate([b, b[:2]])
    result = a[1:4] * b[2:]
    result -= a[2:] * b[1:4]
    return result


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products (...) of vectors (C, ...), coordinates first."""
    return np.einsum("c...,c...->...", a, b)
