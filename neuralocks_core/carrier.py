# SPDX-License-Identifier: Apache-2.0
"""Carrying a deformation of the network's 24 vertices back to the groom's own vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import spans
from .arclength import arc_lengths
from .lengths import keep_lengths
from .turning import turned

if TYPE_CHECKING:
    from .groom import Groom
    from .strands import StrandSet

POINTS = 16_384
"""Points carried at a time, about: what is touched for them stays in the processor's second-level cache."""

BLOCK = 512
"""Strands prepared together, so that preparing takes little memory beside its result, and at most carried at once."""


class Carrier:
    """Moves the groom's own vertices as the network's vertices move.

    Where the groom's strands are the network's (24 vertices, even in arc length), the displacement is added as it is.
    Any other smooth strand's vertices are weighted means of the network's (`spans`). What is finer than the network's
    vertices, coils say, takes the displacement of the network polyline and is turned with it (`turning`). The groom's
    own edges then get their lengths back (`lengths`). Zero displacement gives the groom's own points bit for bit, and
    strands that the network does not move (`StrandSet.valid` false) always stay.

    Args:
        groom: the groom that `strands` was made of.
        strands: its network vertices at rest.
    """

    def __init__(self, groom: Groom, strands: StrandSet) -> None:
        self._groom = groom
        self._rest = strands.rest
        self._valid = strands.valid
        self._facing = None if np.array_equal(strands.facing, np.eye(3)) else strands.facing.astype(np.float32)
        self._all_valid = bool(strands.valid.all())
        self._ends = np.concatenate([groom.starts, [len(groom.points)]])
        self._negative_zero = bool((np.signbit(groom.points) & (groom.points == 0)).any())

        # A power of two, so that no chunk reaches across a border of BLOCK.
        each = POINTS * groom.strand_count / max(len(groom.points), 1)
        self._chunk = 2 ** int(np.clip(np.log2(max(each, 1.0)), 4, np.log2(BLOCK)))
        vertices = strands.rest.shape[1]
        canonical = (groom.points - strands.head_origin) @ strands.facing.T
        self._direct = bool((groom.counts == vertices).all()) and bool(
            np.abs(canonical.reshape(-1, vertices, 3) - strands.rest)[strands.valid].max(initial=0.0) < 1e-6
        )
        if not self._direct:
            self._prepare(canonical)

    def _prepare(self, canonical: np.ndarray) -> None:
        """Find how each own vertex follows the network's."""
        groom, count, vertices = self._groom, *self._rest.shape[:2]
        arc, length = arc_lengths(groom)
        place = arc / np.where(self._valid, length, 1.0)[groom.strand_of_point] * (vertices - 1)
        self._blocks = []
        for low in range(0, count, BLOCK):
            strands = slice(low, min(low + BLOCK, count))
            own = slice(self._ends[low], self._ends[strands.stop])
            self._blocks.append(
                _Block(
                    self._rest[strands],
                    self._valid[strands],
                    canonical[own],
                    groom.strand_of_point[own] - low,
                    place[own],
                )
            )

    def carry(
        self,
        displacement: np.ndarray,
        out: np.ndarray | None = None,
        strands: slice | None = None,
        onto: np.ndarray | None = None,
    ) -> np.ndarray:
        """The groom's own points after a deformation.

        Args:
            displacement: (N, K, 3) float32 [m], canonical axes, for the strands of the slice (all S without
                one).
            out: (points of these strands, 3) float32, filled and returned; made if left out.
            strands: a slice of consecutive strands.
            onto: (P, 3) float32 [m], what is moved instead of the groom's points: these about another origin, say.

        Returns:
            (points of these strands, 3) float32 [m], bind-world space.
        """
        first, last, step = (strands or slice(None)).indices(self._groom.strand_count)
        if step != 1:
            raise ValueError("strands must be consecutive")
        if displacement.shape != (last - first, *self._rest.shape[1:]):
            raise ValueError(f"displacement {displacement.shape} for {last - first} strands")
        begin = self._ends[first]
        onto = self._groom.points if onto is None else onto
        if out is None:
            out = np.empty((self._ends[last] - begin, 3), np.float32)
        start = first
        while start < last:
            stop = min(start - start % self._chunk + self._chunk, last)
            moved = self._moved(np.asarray(displacement[start - first : stop - first], np.float32), start, stop)
            here = slice(self._ends[start], self._ends[stop])
            if not self._direct:
                smooth = ~self._blocks[start // BLOCK].fine(start % BLOCK, stop - start)
                keep_lengths(self._groom.points[here], moved, self._groom.counts[start:stop], smooth)
            part = out[here.start - begin : here.stop - begin]
            np.add(onto[here], moved, out=part)
            if self._negative_zero:  # -0 + 0 is +0: the one value that adding nothing changes
                np.copyto(part, onto[here], where=moved == 0)
            start = stop
        return out

    def _moved(self, displacement: np.ndarray, start: int, stop: int) -> np.ndarray:
        """(points of the strands, 3) displacement of own vertices, bind-world axes."""
        if not self._all_valid:
            displacement = np.where(self._valid[start:stop, None, None], displacement, np.float32(0.0))
        if self._direct:
            moved = displacement.reshape(-1, 3)
        else:
            low = start - start % BLOCK
            own = slice(self._ends[start] - self._ends[low], self._ends[stop] - self._ends[low])
            moved = self._blocks[low // BLOCK].moved(displacement, start - low, own)
        # The inverse of a rotation: rows times R are columns times its transpose.
        return moved if self._facing is None else moved @ self._facing


class _Block:
    """How the own vertices of some strands follow the network's.

    Args:
        rest: (N, K, 3) [m]; valid: (N,).
        own: (P, 3) [m] own vertices; strand: (P,) which strand each belongs to; place: (P,) see `spans.weights`.
    """

    def __init__(self, rest, valid, own, strand, place) -> None:
        vertices = rest.shape[1]
        self._rest = rest
        first, weights, fine = spans.weights(rest, own, strand, place)
        self._fine = fine & valid
        if not self._fine.all():
            # Numbers within a block are small: two bytes for each of the groom's points instead of four.
            self._first = (first + strand * vertices).astype(np.uint16)
            self._weights = np.ascontiguousarray(weights.T)
        self._own = np.flatnonzero(self._fine[strand]).astype(np.int32)
        own, strand, place = own[self._own], strand[self._own], place[self._own]
        segment = np.clip(place.astype(np.int32), 0, vertices - 2)
        share = np.clip(place - segment, 0.0, 1.0)[:, None]
        flat, at = rest.reshape(-1, 3).astype(np.float64), strand * vertices + segment
        self._residual = (own - (flat[at] * (1.0 - share) + flat[at + 1] * share)).astype(np.float32)
        self._share = share.astype(np.float32)
        self._segment = ((np.cumsum(self._fine) - 1)[strand] * vertices + segment).astype(np.int32)

    def moved(self, displacement: np.ndarray, start: int, own: slice) -> np.ndarray:
        """Displacement of own vertices, canonical axes.

        Args:
            displacement: (n, K, 3) of the strands from `start` on.
            own: their own vertices.
        """
        vertices = displacement.shape[1]
        fine = self.fine(start, len(displacement))
        coils = slice(*np.searchsorted(self._own, (own.start, own.stop))) if len(self._own) else slice(0, 0)
        if fine.all():
            return self._turned(displacement, self._rest[start : start + len(fine)], start, coils)
        first, weights = self._first[own].astype(np.intp), self._weights[:, own]
        if start:
            first -= start * vertices
        # One coordinate at a time: three to a row leave a processor's vectors mostly empty.
        moved, part = (np.empty(len(first), np.float32) for _ in range(2))
        flat, result = displacement.reshape(-1, 3), np.empty((len(first), 3), np.float32)
        for axis in range(3):
            along = np.ascontiguousarray(flat[:, axis])
            along.take(first, out=moved, mode="clip")
            moved *= weights[0]
            for node in range(1, spans.NODES):
                along[node:].take(first, out=part, mode="clip")
                part *= weights[node]
                moved += part
            result[:, axis] = moved
        if coils.stop > coils.start:
            rest = self._rest[start : start + len(fine)][fine]
            result[self._own[coils] - own.start] = self._turned(displacement[fine], rest, start, coils)
        return result

    def fine(self, start: int, count: int) -> np.ndarray:
        """(count,) bool, strands from `start` on that are finer than the network's vertices."""
        return self._fine[start : start + count]

    def _turned(self, displacement: np.ndarray, rest: np.ndarray, start: int, coils: slice) -> np.ndarray:
        segment = self._segment[coils] - np.int32(self._fine[:start].sum() * displacement.shape[1])
        return turned(rest, displacement, segment, self._share[coils], self._residual[coils])
