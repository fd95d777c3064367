# SPDX-License-Identifier: Apache-2.0
"""Hair does not stretch: every edge of a moved strand gets its length at rest back."""

from __future__ import annotations

import numpy as np

from neuralocks_core.deformation.scratch import Scratch

TINY = np.float32(1e-24)
"""[m^2] Keeps edges of no length finite, and is too little to change others."""

_scratch = Scratch()


def keep_lengths(points: np.ndarray, moved: np.ndarray, smooth: np.ndarray) -> None:
    """Change displacements so that no edge is longer or shorter than at rest.

    From the root on, each edge keeps about the direction it was moved to, and the hair its way. Where nothing is moved
    nothing changes, bit for bit, and a strand depends on itself alone.

    Coordinates come first and strands last: what is done to one vertex of all strands is one contiguous array.

    Args:
        points: (3, V, N) float32 [m] vertices at rest of N strands of V vertices.
        moved: (3, V, N) float32 [m] their displacement, changed in place.
        smooth: (N,) bool, strands whose edges point along their way; those of a coil point all around.
    """
    vertices, strands = points.shape[1:]
    vectors, numbers = (3, max(vertices - 1, 0), strands), (max(vertices - 1, 0), strands)
    before, edges, drift, other, lengths, squared, scale, along, spare = _scratch.arrays(*[vectors] * 4, *[numbers] * 5)
    np.subtract(points[:, 1:], points[:, :-1], out=before)
    np.subtract(moved[:, 1:], moved[:, :-1], out=edges)
    edges += before
    _dot(before, before, lengths)
    _measure(edges, lengths, squared, scale)
    # Where lengths alone would put each vertex, seen from where it was moved to. Along the hair that does not matter,
    # to its side it takes the hair off its way, into the head even: so much each edge turns back.
    np.subtract(scale, np.float32(1.0), out=spare)
    spare *= smooth
    np.multiply(edges, spare, out=drift)
    drift, other = _add_up(drift, other)
    _dot(drift, edges, along)
    along /= squared
    drift -= np.multiply(edges, along, out=other)
    edges *= scale
    edges -= drift
    edges[:, 1:] += drift[:, :-1]
    _measure(edges, lengths, squared, scale)
    edges *= scale
    edges -= before
    edges, _ = _add_up(edges, other)
    np.add(moved[:, :1], edges, out=moved[:, 1:])


def keep_lengths_of_any(points: np.ndarray, moved: np.ndarray, counts: np.ndarray, smooth: np.ndarray) -> None:
    """`keep_lengths` of strands of any numbers of vertices.

    Args:
        points: (3, P) float32 [m] vertices at rest of consecutive strands.
        moved: (3, P) float32 [m] their displacement, changed in place.
        counts: (N,) vertices of each strand, at least one.
        smooth: (N,) bool, as above.
    """
    # Strands of about the same number of vertices together; the last vertex is repeated: an edge of no length.
    starts, alike = np.cumsum(counts) - counts, np.frexp(counts)[1]
    for size in np.unique(alike):
        some = np.flatnonzero(alike == size)
        last = counts[some] - 1
        place = np.arange(last.max() + 1)[:, None]
        grid, own = starts[some] + np.minimum(place, last), place <= last
        kept = moved[:, grid]
        keep_lengths(points[:, grid], kept, smooth[some])
        moved[:, grid[own]] = kept[:, own]


def _measure(edges: np.ndarray, lengths: np.ndarray, squared: np.ndarray, scale: np.ndarray) -> None:
    """Squared lengths of edges, and the factors that give them the lengths whose squares are `lengths`."""
    _dot(edges, edges, squared)
    squared += TINY
    np.sqrt(np.divide(lengths, squared, out=scale), out=scale)


def _add_up(edges: np.ndarray, spare: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums along the strands, and what is left of the two arrays, in which anything may be now."""
    # Sums of 2, 4, 8 ... of them: the same numbers however many strands there are, in few calls, between which threads
    # take turns.
    reach = 1
    while reach < edges.shape[1]:
        spare[:, :reach] = edges[:, :reach]
        np.add(edges[:, reach:], edges[:, :-reach], out=spare[:, reach:])
        edges, spare, reach = spare, edges, 2 * reach
    return edges, spare


def _dot(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> np.ndarray:
    """(V, N) products of vectors whose coordinates come first."""
    return np.einsum("cvn,cvn->vn", a, b, out=out)
