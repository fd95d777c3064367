# SPDX-License-Identifier: Apache-2.0
"""Hair does not stretch: every edge of a moved strand gets its length at rest back."""

from __future__ import annotations

import numpy as np

TINY = np.float32(1e-24)
"""[m^2] Keeps edges of no length finite."""


def keep_lengths(rest: np.ndarray, moved: np.ndarray, counts: np.ndarray, smooth: np.ndarray) -> None:
    """Change displacements so that no edge is longer or shorter than at rest.

    From the root on, each edge keeps about the direction it was moved to, and the hair its way. Where nothing is moved
    nothing changes, bit for bit, and a strand depends on itself alone.

    Args:
        rest: (P, 3) float32 [m] vertices of consecutive strands.
        moved: (P, 3) float32 [m] their displacement, changed in place.
        counts: (N,) vertices of each strand, at least one.
        smooth: (N,) bool, strands whose edges point along their way; those of a coil point all around.
    """
    if not len(counts):
        return
    if (counts == counts[0]).all():
        shape = len(counts), counts[0], 3
        moved.reshape(shape)[:] = _kept(rest.reshape(shape), moved.reshape(shape), smooth)
        return
    # Strands of about the same number of vertices together; the last vertex is repeated: an edge of no length.
    starts, alike = np.cumsum(counts) - counts, np.frexp(counts)[1]
    for size in np.unique(alike):
        some = np.flatnonzero(alike == size)
        last = counts[some] - 1
        grid = starts[some, None] + np.minimum(np.arange(last.max() + 1), last[:, None])
        moved[grid] = _kept(rest[grid], moved[grid], smooth[some])


def _kept(rest: np.ndarray, moved: np.ndarray, smooth: np.ndarray) -> np.ndarray:
    """(N, V, 3) displacement of N strands of V vertices that keeps their lengths."""
    # Coordinates first, strands last: what is done to one vertex of all strands is one contiguous array.
    points, result = (np.ascontiguousarray(a.transpose(2, 1, 0)) for a in (rest, moved))
    before = points[:, 1:] - points[:, :-1]
    edges = result[:, 1:] - result[:, :-1]
    edges += before
    lengths, squared = _dot(before, before), np.maximum(_dot(edges, edges), TINY)
    scale = np.sqrt(lengths / squared)
    # Where lengths alone would put each vertex, seen from where it was moved to. Along the hair that does not matter,
    # to its side it takes the hair off its way, into the head even: so much each edge turns back.
    drift = edges * ((scale - np.float32(1.0)) * smooth)
    _add_up(drift)
    drift -= _dot(drift, edges) / squared * edges
    edges *= scale
    edges -= drift
    edges[:, 1:] += drift[:, :-1]
    edges *= np.sqrt(lengths / np.maximum(_dot(edges, edges), TINY))
    edges -= before
    _add_up(edges)
    np.add(result[:, :1], edges, out=result[:, 1:])
    return result.transpose(2, 1, 0)


def _add_up(edges: np.ndarray) -> None:
    """Sums along the strands, in place."""
    if edges.shape[1] > edges.shape[2]:
        np.cumsum(edges, axis=1, out=edges)
        return
    # The same sums, for many strands at a time: four times as fast where they are many.
    for vertex in range(1, edges.shape[1]):
        edges[:, vertex] += edges[:, vertex - 1]


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(V, N) products of vectors whose coordinates come first."""
    total = a[0] * b[0]
    for left, right in zip(a[1:], b[1:]):
        total += left * right
    return total
