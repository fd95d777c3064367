# SPDX-License-Identifier: Apache-2.0
"""Carrying a deformation of the network's 24 vertices back to the groom's own vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import spans
from .arclength import arc_lengths
from .turning import turned

if TYPE_CHECKING:
    from .groom import Groom
    from .strands import StrandSet

POINTS = 16_384
"""Points carried at a time, about: what is touched for them stays in the processor's second-level cache."""

_PREPARED = 512
"""Strands prepared at a time, so that preparing takes little memory beside its result."""


class Carrier:
    """Moves the groom's own vertices as the network's vertices move.

    Where the groom's strands are the network's (24 vertices, even in arc length), the displacement is added as it is.
    Any other smooth strand's vertices are weighted means of the network's (`spans`). What is finer than the network's
    vertices, coils say, takes the displacement of the network polyline and is turned with it (`turning`). Zero
    displacement gives the groom's own points bit for bit, and strands that the network does not move
    (`StrandSet.valid` false) always stay.

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

        # A power of two, so that no chunk reaches across a border of _PREPARED.
        each = POINTS * groom.strand_count / max(len(groom.points), 1)
        self._chunk = 2 ** int(np.clip(np.log2(max(each, 1.0)), 4, np.log2(_PREPARED)))
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
        self._fine = np.zeros(count, np.bool_)
        means, fine = [], []
        for low in range(0, count, _PREPARED):
            high = min(low + _PREPARED, count)
            here = slice(self._ends[low], self._ends[high])
            strand = groom.strand_of_point[here] - low
            means_here, fine_here = self._prepared(low, high, canonical[here], strand, place[here])
            means.append(means_here)
            fine.append(fine_here)
        self._first, self._weights = (np.concatenate(parts) for parts in zip(*means, strict=True))
        self._segment, self._share, self._residual = (np.concatenate(parts) for parts in zip(*fine, strict=True))
        self._rank = np.concatenate([[0], np.cumsum(self._fine)])
        self._fine_ends = np.concatenate([[0], np.cumsum(np.where(self._fine, groom.counts, 0))])

    def _prepared(self, low: int, high: int, own: np.ndarray, strand: np.ndarray, place: np.ndarray):
        """The same for the strands from `low` to `high`: arrays of those that are means, and of those that turn."""
        rest, valid, vertices = self._rest[low:high], self._valid[low:high], self._rest.shape[1]
        first, weights, fine = spans.weights(rest, own, strand, place)
        fine &= valid
        self._fine[low:high] = fine
        of_fine = fine[strand]
        first += (strand * vertices).astype(np.int32)
        means = first[~of_fine], weights[~of_fine]

        own, strand, place = own[of_fine], strand[of_fine], place[of_fine]
        segment = np.clip(place.astype(np.int32), 0, vertices - 2)
        share = np.clip(place - segment, 0.0, 1.0)[:, None]
        flat, at = rest.reshape(-1, 3).astype(np.float64), strand * vertices + segment
        residual = own - (flat[at] * (1.0 - share) + flat[at + 1] * share)
        rank = (np.cumsum(fine) - 1)[strand]
        at = (rank * vertices + segment).astype(np.int32)
        return means, (at, share.astype(np.float32), residual.astype(np.float32))

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
            fine = self._fine[start:stop]
            turning = self._rank[stop] - self._rank[start]
            if not turning:
                moved = self._means(displacement, start, stop)
            elif turning == stop - start:
                moved = self._turned(displacement, self._rest[start:stop], start, stop)
            else:
                own = np.repeat(fine, self._groom.counts[start:stop])
                moved = np.empty((len(own), 3), np.float32)
                moved[~own] = self._means(displacement, start, stop)
                moved[own] = self._turned(displacement[fine], self._rest[start:stop][fine], start, stop)
        # The inverse of a rotation: rows times R are columns times its transpose.
        return moved if self._facing is None else moved @ self._facing

    def _means(self, displacement: np.ndarray, start: int, stop: int) -> np.ndarray:
        here = slice(*(int(self._ends[s] - self._fine_ends[s]) for s in (start, stop)))
        first = self._first[here] - np.int32(start % _PREPARED * displacement.shape[1])
        weights, flat = self._weights[here], displacement.reshape(-1, 3)
        moved = flat.take(first, axis=0)
        moved *= weights[:, :1]
        for node in range(1, spans.NODES):
            part = flat[node:].take(first, axis=0)
            part *= weights[:, node : node + 1]
            moved += part
        return moved

    def _turned(self, displacement: np.ndarray, rest: np.ndarray, start: int, stop: int) -> np.ndarray:
        here = slice(self._fine_ends[start], self._fine_ends[stop])
        before = self._rank[start] - self._rank[start - start % _PREPARED]
        segment = self._segment[here] - np.int32(before * displacement.shape[1])
        return turned(rest, displacement, segment, self._share[here], self._residual[here])
