# SPDX-License-Identifier: Apache-2.0
"""How a groom's own vertices follow the network's."""

from __future__ import annotations

import numpy as np

from neuralocks_core.deformation import spans
from neuralocks_core.deformation.lengths import keep_lengths
from neuralocks_core.deformation.turning import turned

BLOCK = 512
"""Strands prepared together, so that preparation needs little memory besides its result."""


class Following:
    """Displacements of own vertices.

    They are means of the network's vertices (`spans`), or turn with the strand where its detail is finer (`turning`), and lengths
    are kept (`lengths`).

    Args:
        rest: (S, K, 3) float32 [m], the network's vertices.
        valid: (S,) bool, strands that move.
        own: (P, 3) [m] own vertices, same axes.
        counts: (S,) how many own vertices each strand has.
        place: (P,) in [0, K - 1], position along the strand in network segments.

    Attributes:
        first: (P,) uint8, the first network vertex that an own vertex is a mean of.
        weights: (P, spans.NODES) float32 of this vertex and the next ones.
        coil: (S,) int32, which of F coils a strand is, or -1.
        edges: (F, K - 1, 3) float32 [m], a coil's network segments at rest.
        begin: (F,) int64, a coil's first vertex in the next three, which hold those of all coils.
        segment: (C,) uint8, the network segment at which a vertex lies.
        share: (C,) float32 of the distance to its end.
        beside: (C, 3) float32 [m] from the network's polyline to the vertex.
    """

    def __init__(self, rest, valid, own, counts, place) -> None:
        self._ends = np.concatenate([[0], np.cumsum(counts)])
        count, vertices = rest.shape[:2]
        self.first = np.empty(len(own), np.uint8)
        self.weights = np.empty((len(own), spans.NODES), np.float32)
        fine = np.zeros(count, bool)
        for low in range(0, count, BLOCK):
            some = slice(low, low + BLOCK)
            here = slice(self._ends[low], self._ends[min(low + BLOCK, count)])
            strand = np.repeat(np.arange(len(rest[some])), counts[some])
            self.first[here], self.weights[here], detailed = spans.weights(rest[some], own[here], strand, place[here])
            fine[some] = detailed & valid[some]
        self.coil = np.where(fine, np.cumsum(fine) - 1, -1).astype(np.int32)
        self.edges = np.diff(rest[fine], axis=1)
        self.begin = np.cumsum(counts[fine]) - counts[fine]
        chosen = np.repeat(fine, counts)
        place, strand = place[chosen], np.repeat(np.arange(count), counts)[chosen]
        segment = np.clip(place.astype(int), 0, vertices - 2)
        share = np.clip(place - segment, 0.0, 1.0)
        flat, at = rest.reshape(-1, 3), strand * vertices + segment
        line = flat[at] * (1.0 - share[:, None]) + flat[at + 1] * share[:, None]
        self.beside = (own[chosen] - line).astype(np.float32)
        self.segment, self.share = segment.astype(np.uint8), share.astype(np.float32)

    def moved(self, displacement: np.ndarray, start: int, points: np.ndarray) -> np.ndarray:
        """Displacement (P', 3) float32 [m] of the own vertices of strands from `start` on.

        Args:
            displacement: (n, K, 3) float32 [m] of the network's vertices.
            start: number of the first of these n strands.
            points: (P', 3) float32 [m] own vertices at rest.
        """
        result = np.empty_like(points)
        ends = self._ends[start : start + len(displacement) + 1]
        counts = np.diff(ends)
        coil = self.coil[start : start + len(displacement)]
        for count in np.unique(counts[counts > 0]):
            for fine in (False, True):
                strands = np.flatnonzero((counts == count) & ((coil >= 0) == fine))
                if not len(strands):
                    continue
                own = ends[strands, None] + np.arange(count)
                network, here = displacement[strands], own - ends[0]
                if fine:
                    of = coil[strands]
                    at = self.begin[of, None] + np.arange(count)
                    moved = turned(self.edges[of], network, self.segment[at], self.share[at], self.beside[at])
                else:
                    moved = means(network, self.first[own], self.weights[own])
                result[here] = keep_lengths(points[here], moved, not fine)
        return result


def means(network: np.ndarray, first: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Means (N, V, 3) of network vertices (N, K, 3): of each own vertex's `first` (N, V) and the next ones, by its weights
    (N, V, spans.NODES).
    """
    strand = np.arange(len(network))[:, None]
    terms = [network[strand, first.astype(int) + node] * weights[..., node, None] for node in range(spans.NODES)]
    return ((terms[0] + terms[1]) + terms[2]) + terms[3]
