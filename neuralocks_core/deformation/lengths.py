# SPDX-License-Identifier: Apache-2.0
"""Hair does not stretch: every edge of a moved strand gets its length at rest back."""

from __future__ import annotations

import numpy as np

from neuralocks_core.deformation.scratch import Scratch, in_turn

TINY = np.float32(1e-24)
"""[m^2] Keeps zero-length edges finite, and is too small to change others."""

_scratch = Scratch()


def keep_lengths(points: np.ndarray, steps: np.ndarray, spare: np.ndarray, smooth: np.ndarray) -> np.ndarray:
    """Displacements with which no edge is longer or shorter than at rest.

    From the root on, each edge about keeps the direction it was moved to, and the hair its path. What does not move stays the
    same, bit for bit, and a strand depends only on itself.

    Coordinates come first and strands last: what is done to one vertex of all strands is one contiguous array.

    Args:
        points: (3, V, N) float32 [m] vertices at rest of N strands of V vertices.
        steps: (3, V, N) float32 [m] how much more each vertex is displaced than the one before it, and the root as a
            whole; overwritten.
        spare: (3, V, N) float32, scratch memory.
        smooth: (N,) bool, strands whose edges point along their path; a coil's point all around.

    Returns:
        (3, V, N) float32 [m], in the memory of `steps` or `spare`.
    """
    edges, other = steps[:, 1:], spare[:, 1:]
    before, drift, lengths, squared, scale, along = in_turn.arrays(*[edges.shape] * 2, *[edges.shape[1:]] * 4)
    np.subtract(points[:, 1:], points[:, :-1], out=before)
    edges += before
    _dot(before, before, lengths)
    _measure(edges, lengths, squared, scale)
    # Restoring lengths alone would make each vertex drift from where it was moved to, by the sum of (scale - 1) edge. Drift
    # along the hair does not matter, but sideways drift takes the hair off its path, even into the head: each edge is turned
    # back by it. If `along` times its own edge is the part of a vertex's drift along the hair, an edge without the sideways
    # drift of its ends is, apart from its length, edge_i (1 + along_i) - edge_(i-1) along_(i-1).
    scale -= np.float32(1.0)
    scale *= smooth
    np.multiply(edges, scale, out=drift)
    drift, other = _add_up(drift, other)
    _dot(drift, edges, along)
    along /= squared
    np.multiply(edges, along, out=other)
    edges += other
    edges[:, 1:] -= other[:, :-1]
    _measure(edges, lengths, squared, scale)
    edges *= scale
    edges -= before
    return _add_up(steps, spare)[0]


def keep_lengths_of_any(points: np.ndarray, moved: np.ndarray, counts: np.ndarray, smooth: np.ndarray) -> None:
    """`keep_lengths` for strands with any numbers of vertices.

    Args:
        points: (3, P) float32 [m] vertices at rest of consecutive strands.
        moved: (3, P) float32 [m] their displacement, changed in place.
        counts: (N,) vertices of each strand.
        smooth: (N,) bool, as above.
    """
    # Strands with about the same number of vertices go together; the last vertex is repeated: an edge of zero length.
    starts, alike = np.cumsum(counts) - counts, np.frexp(counts)[1]
    # For each strand, the index of its root in what is kept, and the step from one vertex to the next.
    column, across = np.empty((2, len(counts)), np.intp)
    kept, end = [], 0
    for size in np.unique(alike[counts > 0]):
        some = np.flatnonzero(alike == size)
        last = counts[some] - 1
        grid = starts[some] + np.minimum(np.arange(last.max() + 1)[:, None], last)
        rest, spare, steps = _scratch.arrays(*[(3, *grid.shape)] * 3)
        points.take(grid, axis=1, out=rest, mode="clip")
        moved.take(grid, axis=1, out=spare, mode="clip")
        steps[:, 0] = spare[:, 0]
        np.subtract(spare[:, 1:], spare[:, :-1], out=steps[:, 1:])
        kept.append(keep_lengths(rest, steps, spare, smooth[some]).reshape(3, -1).copy())
        column[some], across[some] = end + np.arange(len(some)), len(some)
        end += grid.size
    if not kept:
        return
    vertex = np.arange(moved.shape[1]) - np.repeat(starts, counts)
    source = np.repeat(column, counts) + vertex * np.repeat(across, counts)
    np.concatenate(kept, axis=1).take(source, axis=1, out=moved, mode="clip")


def _measure(edges: np.ndarray, lengths: np.ndarray, squared: np.ndarray, scale: np.ndarray) -> None:
    """Squared lengths of edges, and the factors that give them the lengths whose squares are `lengths`."""
    _dot(edges, edges, squared)
    squared += TINY
    np.sqrt(np.divide(lengths, squared, out=scale), out=scale)


def _add_up(edges: np.ndarray, spare: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums along the strands, and the other of the two arrays, whose content is arbitrary."""
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
