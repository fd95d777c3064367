# SPDX-License-Identifier: Apache-2.0
"""How a groom's own vertices follow the network's.

Coordinates come first in arrays here, (3, ...): rows of three would leave a processor's vector units mostly idle.
"""

from __future__ import annotations

import numpy as np

from neuralocks_core.deformation import spans
from neuralocks_core.deformation.lengths import keep_lengths, keep_lengths_of_any
from neuralocks_core.deformation.scratch import Scratch, in_turn
from neuralocks_core.deformation.turning import Coils

WIDEST = spans.NODES + 4
"""Strands are laid out as a grid if each own vertex depends on at most this many network vertices over all strands."""

_scratch = Scratch()


class Following:
    """Displacements of the own vertices of some strands.

    They are means of the network's vertices (`spans`), turned with the strand where its detail is finer (`turning`), and
    lengths are kept (`lengths`).

    Args:
        rest: (N, K, 3) [m], the network's vertices.
        valid: (N,) bool, strands that move.
        own: (P, 3) [m] own vertices, same axes.
        counts: (N,) how many own vertices each strand has.
        place: (P,) in [0, K - 1], position along the strand in network segments.
    """

    def __init__(self, rest, valid, own, counts, place) -> None:
        strand = np.repeat(np.arange(len(counts)), counts)
        first, weights, fine = spans.weights(rest, own, strand, place)
        self._fine = fine & valid
        self._ends = np.concatenate([[0], np.cumsum(counts)])
        # Grooming tools write the same number of vertices in each strand, each at about the same place in all of them.
        grid = first.reshape(len(counts), -1) if counts[0] > 1 and (counts == counts[0]).all() else None
        self._each = None if grid is None or np.ptp(grid, axis=0).max() > WIDEST - spans.NODES else int(counts[0])
        self._means = _Varied(first, weights, strand, rest.shape[1]) if self._each is None else _Alike(grid, weights)
        self._coils = Coils(rest, own, strand, place, self._fine) if self._fine.any() else None

    def columns(self, points: np.ndarray) -> np.ndarray:
        """The layout in which `moved` works, a view of points (P', 3) of these strands: (3, V, N) of strands of V
        vertices, else (3, P').
        """
        return points.T if self._each is None else points.reshape(-1, self._each, 3).transpose(2, 1, 0)

    def moved(self, displacement: np.ndarray, start: int, points: np.ndarray) -> np.ndarray:
        """Displacement of own vertices, laid out as `columns` has it; valid until this thread's next call.

        Args:
            displacement: (n, K, 3) [m] of the network's vertices of the strands from `start` on.
            points: own vertices of these strands at rest, as `columns` lays them out.
        """
        stop = start + len(displacement)
        fine, ends = self._fine[start:stop], self._ends[start : stop + 1]
        result, spare = _scratch.arrays(*[points.shape] * 2)
        if self._each:
            if not fine.all():
                self._means.put(displacement, start, result, spare)
            if fine.any():
                coils = self._coils.moved(displacement[fine], start).reshape(3, -1, self._each).transpose(0, 2, 1)
                coils[:, 1:] -= coils[:, :-1].copy()
                result[..., fine] = coils
            return keep_lengths(points, result, spare, ~fine)
        if not fine.all():
            self._means.put(displacement, start, slice(ends[0], ends[-1]), result)
        counts = np.diff(ends)
        if fine.any():
            result[:, np.repeat(fine, counts)] = self._coils.moved(displacement[fine], start)
        keep_lengths_of_any(points, result, counts, ~fine)
        return result


class _Alike:
    """Means in strands of V vertices each, as steps from one vertex to the next, as `keep_lengths` needs them.

    Args:
        first: (N, V) first network vertex that an own vertex is a mean of, counted from its strand's root.
        weights: (N V, spans.NODES) of this vertex and the next ones.
    """

    def __init__(self, first: np.ndarray, weights: np.ndarray) -> None:
        weights = weights.reshape(*first.shape, spans.NODES).T
        # Relative to the root, a vertex moves by a share of each of the network's steps up to it: all of those before its first
        # network vertex, and of the next three the sum of the weights beyond.
        beyond, first = np.cumsum(weights[:0:-1], axis=0, dtype=float)[::-1], first.T

        def share(own: slice, step: np.ndarray) -> np.ndarray:
            late = step - first[own]
            result = (late < 0).astype(float)
            for node in range(spans.NODES - 1):
                np.copyto(result, beyond[node, own], where=late == node)
            return result

        # The network's steps that own steps depend on, from the first of any strand to the last of any strand: the number of
        # each, and its shares (V', N). Few own steps depend on more than four.
        low, high = first[:-1].min(axis=1), first[1:].max(axis=1) + spans.NODES - 2
        self._terms = []
        for late in range((high - low).max() + 1):
            needed = np.flatnonzero(low + late <= high)
            begin, end = needed[0], needed[-1] + 1
            of = low[begin:end] + late
            term = share(slice(begin + 1, end + 1), of[:, None]) - share(slice(begin, end), of[:, None])
            self._terms.append((begin, end, of, term.astype(np.float32, order="C")))

    def put(self, displacement: np.ndarray, start: int, result: np.ndarray, spare: np.ndarray) -> None:
        """Write into `result` (3, V, n), for strands from `start` on; `spare` is scratch memory of the same shape."""
        count, vertices = displacement.shape[:2]
        network, steps = in_turn.arrays((3, vertices, count), (3, vertices - 1, count))
        network[:] = displacement.transpose(2, 1, 0)
        np.subtract(network[:, 1:], network[:, :-1], out=steps)
        result[:, 0] = network[:, 0]
        whole = result[:, 1:]
        for number, (begin, end, of, shares) in enumerate(self._terms):
            # Contiguous memory, or `take` would fill a copy first.
            part = spare.reshape(-1)[: 3 * len(of) * count].reshape(3, len(of), count)
            steps.take(of, axis=1, out=part, mode="clip")
            if number:
                part *= shares[:, start : start + count]
                whole[:, begin:end] += part
            else:
                np.multiply(part, shares[:, start : start + count], out=whole)


class _Varied:
    """Means in strands of any numbers of vertices, at any places.

    Args:
        first, weights: see `spans.weights`.
        strand: (P,) which strand each own vertex belongs to.
        vertices: of the network.
    """

    def __init__(self, first: np.ndarray, weights: np.ndarray, strand: np.ndarray, vertices: int) -> None:
        # Numbers within a block are small: two bytes for each of the groom's points instead of four.
        self._first = (first + strand * vertices).astype(np.uint16)
        self._weights = np.ascontiguousarray(weights.T)

    def put(self, displacement: np.ndarray, start: int, own: slice, result: np.ndarray) -> None:
        """Write own vertices `own` of the strands from `start` on into `result` (3, P')."""
        first, weights = self._first[own].astype(np.intp), self._weights[:, own]
        first -= start * displacement.shape[1]
        part, flat = np.empty(len(first), np.float32), displacement.reshape(-1, 3)
        for axis, moved in enumerate(result):
            along = np.ascontiguousarray(flat[:, axis])
            along.take(first, out=moved, mode="clip")
            moved *= weights[0]
            for node in range(1, spans.NODES):
                along[node:].take(first, out=part, mode="clip")
                part *= weights[node]
                moved += part
