# SPDX-License-Identifier: Apache-2.0
"""Hair does not stretch: every edge of a moved strand gets its length at rest back."""

from __future__ import annotations

import threading

import numpy as np

KEPT = 65_536
"""Most vertices for which a thread keeps its memory."""
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
        place = np.arange(last.max() + 1)
        grid, own = starts[some, None] + np.minimum(place, last[:, None]), place <= last[:, None]
        moved[grid[own]] = _kept(rest[grid], moved[grid], smooth[some])[own]


def _kept(rest: np.ndarray, moved: np.ndarray, smooth: np.ndarray) -> np.ndarray:
    """(N, V, 3) displacement of N strands of V vertices that keeps their lengths; valid until this thread's next call."""
    # Coordinates first, strands last: what is done to one vertex of all strands is one contiguous array.
    room = _scratch.arrays(rest.shape[1], len(rest))
    points, result = room.points, room.result
    points[:], result[:] = rest.transpose(2, 1, 0), moved.transpose(2, 1, 0)
    before, edges, drift = room.before, room.edges, room.drift
    np.subtract(points[:, 1:], points[:, :-1], out=before)
    np.subtract(result[:, 1:], result[:, :-1], out=edges)
    edges += before
    lengths, squared, scale = room.lengths, room.squared, room.scale
    _dot(before, before, lengths, room.spare)
    _measure(edges, lengths, room)
    # Where lengths alone would put each vertex, seen from where it was moved to. Along the hair that does not matter,
    # to its side it takes the hair off its way, into the head even: so much each edge turns back.
    np.subtract(scale, np.float32(1.0), out=room.spare)
    room.spare *= smooth
    np.multiply(edges, room.spare, out=drift)
    _add_up(drift, room.other)
    along = _dot(drift, edges, room.along, room.spare)
    along /= squared
    drift -= np.multiply(edges, along, out=room.other)
    edges *= scale
    edges -= drift
    edges[:, 1:] += drift[:, :-1]
    _measure(edges, lengths, room)
    edges *= scale
    edges -= before
    _add_up(edges, room.other)
    np.add(result[:, :1], edges, out=result[:, 1:])
    return result.transpose(2, 1, 0)


def _measure(edges: np.ndarray, lengths: np.ndarray, room: _Room) -> None:
    """Into `room`: squared lengths of edges, and the factors that give them the lengths whose squares are `lengths`."""
    np.maximum(_dot(edges, edges, room.squared, room.spare), TINY, out=room.squared)
    np.sqrt(np.divide(lengths, room.squared, out=room.scale), out=room.scale)


def _add_up(edges: np.ndarray, spare: np.ndarray) -> None:
    """Sums along the strands, in place."""
    # Sums of 2, 4, 8 ... of them: the same numbers however many strands there are, in few calls, between which threads
    # take turns.
    reach = 1
    while reach < edges.shape[1]:
        spare[:] = edges
        edges[:, reach:] += spare[:, :-reach]
        reach *= 2


def _dot(a: np.ndarray, b: np.ndarray, out: np.ndarray, spare: np.ndarray) -> np.ndarray:
    """(V, N) products of vectors whose coordinates come first."""
    np.multiply(a[0], b[0], out=out)
    for left, right in zip(a[1:], b[1:]):
        out += np.multiply(left, right, out=spare)
    return out


class _Room:
    """Arrays for N strands of V vertices, cut from one piece of memory."""

    SIZE = 23
    """Numbers a vertex."""

    def __init__(self, memory: np.ndarray, vertices: int, strands: int) -> None:
        self.vertices, self.strands = vertices, strands
        self._memory, self._taken = memory, 0
        self.points, self.result = (self._cut(3, vertices) for _ in range(2))
        self.before, self.edges, self.drift, self.other = (self._cut(3, vertices - 1) for _ in range(4))
        self.lengths, self.squared, self.scale, self.along, self.spare = (
            self._cut(1, vertices - 1)[0] for _ in range(5)
        )

    def _cut(self, coordinates: int, vertices: int) -> np.ndarray:
        begin = self._taken
        self._taken += coordinates * vertices * self.strands
        return self._memory[begin : self._taken].reshape(coordinates, vertices, self.strands)


class _Scratch(threading.local):
    """The last room of each thread, for a groom's chunks are alike: memory that is asked for anew each time costs more
    than what is computed in it.
    """

    room: _Room | None = None

    def arrays(self, vertices: int, strands: int) -> _Room:
        """Room for so many; what is in it is anything."""
        room = self.room
        if room is None or (room.vertices, room.strands) != (vertices, strands):
            room = _Room(np.empty(_Room.SIZE * vertices * strands, np.float32), vertices, strands)
            self.room = room if vertices * strands <= KEPT else None
        return room


_scratch = _Scratch()
