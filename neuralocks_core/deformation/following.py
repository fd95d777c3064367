# SPDX-License-Identifier: Apache-2.0
"""How a groom's own vertices follow the network's.

Coordinates come first in arrays here, (3, ...): three to a row leave a processor's vectors mostly empty.
"""

from __future__ import annotations

import numpy as np

from neuralocks_core.deformation import spans
from neuralocks_core.deformation.lengths import keep_lengths, keep_lengths_of_any
from neuralocks_core.deformation.scratch import Scratch
from neuralocks_core.deformation.turning import Coils

WIDEST = spans.NODES + 4
"""Strands are laid out as a grid where each own vertex depends on at most so many network vertices over all strands."""

BASE = 1
"""The step from an own vertex's first network vertex to the one that it lies nearest to, as a rule."""

_scratch, _network = Scratch(), Scratch()


class Following:
    """Displacements of the own vertices of some strands.

    Means of the network's vertices (`spans`), turned with them where strands are finer than these (`turning`), with
    their lengths kept (`lengths`).

    Args:
        rest: (N, K, 3) [m], the network's vertices.
        valid: (N,) bool, strands that move.
        own: (P, 3) [m] own vertices, same axes.
        counts: (N,) how many of these each strand has.
        place: (P,) in [0, K - 1], position along the strand in network segments.
    """

    def __init__(self, rest, valid, own, counts, place) -> None:
        strand = np.repeat(np.arange(len(counts)), counts)
        first, weights, fine = spans.weights(rest, own, strand, place)
        self._fine = fine & valid
        self._ends = np.concatenate([[0], np.cumsum(counts)])
        # As many vertices in each strand, each at about the same place in all of them, is what grooming tools write.
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
        (result,) = _scratch.arrays(points.shape)
        if not fine.all():
            self._means.put(displacement, start, slice(ends[0], ends[-1]), result)
        counts = np.diff(ends)
        if fine.any():
            coils = fine if self._each else np.repeat(fine, counts)
            result[..., coils] = self.columns(self._coils.moved(displacement[fine], start))
        if self._each:
            keep_lengths(points, result, ~fine)
        else:
            keep_lengths_of_any(points, result, counts, ~fine)
        return result


class _Alike:
    """Means in strands of V vertices each.

    Args:
        first: (N, V) first network vertex that an own vertex is a mean of.
        weights: (N V, spans.NODES) of it and the next ones.
    """

    def __init__(self, first: np.ndarray, weights: np.ndarray) -> None:
        weights = weights.reshape(*first.shape, spans.NODES).T
        low, late = first.min(axis=0), first.T - first.min(axis=0)[:, None]
        reach = late.max(axis=1) + spans.NODES
        # From the first to the last own vertex that needs it: a network vertex of each, and its weights (V', N). Few own
        # vertices need more than four. All weights of a vertex add up to one: those of BASE, which all need, are not kept.
        self._base, self._terms = low + BASE, []
        for step in range(reach.max()):
            if step == BASE:
                continue
            needed = np.flatnonzero(reach > step)
            own = slice(needed[0], needed[-1] + 1)
            term = np.zeros((own.stop - own.start, len(first)), np.float32)
            for node in range(spans.NODES):
                np.copyto(term, weights[node, own], where=late[own] + node == step)
            self._terms.append((own, low[own] + step, term))

    def put(self, displacement: np.ndarray, start: int, own: slice, result: np.ndarray) -> None:
        """Into `result` (3, V, n), of strands from `start` on."""
        count, vertices = displacement.shape[:2]
        network, base, spare = _network.arrays((3, vertices, count), *[result.shape] * 2)
        network[:] = displacement.transpose(2, 1, 0)
        network.take(self._base, axis=1, out=base, mode="clip")
        so_far = base
        for own, of, weights in self._terms:
            part = spare[:, own]
            network.take(of, axis=1, out=part, mode="clip")
            part -= base[:, own]
            part *= weights[:, start : start + count]
            np.add(so_far[:, own], part, out=result[:, own])
            so_far = result


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
        """Into `result` (3, P'), own vertices `own` of the strands from `start` on."""
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
