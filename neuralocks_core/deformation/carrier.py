# SPDX-License-Identifier: Apache-2.0
"""Transfers a deformation of the network's 24 vertices to the groom's own, and these to where they are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from neuralocks_core.deformation.following import Following
from neuralocks_core.native.carry import Carry
from neuralocks_core.strands.arclength import arc_lengths
from neuralocks_core.sums import times

if TYPE_CHECKING:
    from neuralocks_core.groom import Groom
    from neuralocks_core.strands.strand_set import StrandSet


class Placing(NamedTuple):
    """Where a carried groom is put: `linear` (x - `centre`) + `origin`, relative to the head's own position, so that
    coordinates far from the origin lose no precision.

    Attributes:
        linear: (3, 3) float32.
        centre: (3,) float32 [m], bind-world space.
        origin: (3,) float32, where the centre is put.
    """

    linear: np.ndarray
    centre: np.ndarray
    origin: np.ndarray

    @classmethod
    def of(cls, transform: np.ndarray, centre: np.ndarray) -> Placing:
        """Make it from the transform (4, 4) of bind-world points and the head's own position (3,) there."""
        centre = centre.astype(np.float32)
        origin = transform[:3, :3] @ centre.astype(float) + transform[:3, 3]
        return cls(transform[:3, :3].astype(np.float32), centre, origin.astype(np.float32))


class Carrier:
    """Moves the groom's own vertices as the network's vertices move.

    If the groom's strands are the network's (24 vertices, even in arc length), the displacement is added directly. The vertices
    of any other smooth strand are weighted means of the network's (`spans`). Detail finer than the network's vertices, such as
    coils, takes the displacement of the network polyline and turns with it (`turning`). Then the groom's own edges get their
    lengths back (`lengths`). Zero displacement gives the groom's own points bit for bit, and strands that the network does not
    move (`StrandSet.valid` false) always stay.

    Args:
        groom: the groom that `strands` was made from.
        strands: its network vertices at rest.
    """

    def __init__(self, groom: Groom, strands: StrandSet) -> None:
        self._groom = groom
        self._vertices = strands.rest.shape[1:]
        self._still = ~strands.valid
        self._facing = None if np.array_equal(strands.facing, np.eye(3)) else strands.facing.astype(np.float32)
        self._ends = np.concatenate([groom.starts, [len(groom.points)]]).astype(np.int64)
        rest = strands.rest if self._facing is None else self._in_bind_axes(strands.rest)
        own = groom.points - strands.head_origin
        direct = bool((groom.counts == len(rest[0])).all()) and bool(
            np.abs(own.reshape(rest.shape) - rest)[strands.valid].max(initial=0.0) < 1e-6
        )
        self._following = None
        if not direct:
            arc, length = arc_lengths(groom)
            place = arc / np.where(strands.valid, length, 1.0)[groom.strand_of_point] * (self._vertices[0] - 1)
            self._following = Following(rest, strands.valid, own, groom.counts, place)
        self._compiled = None
        if Carry.serves(self._vertices[0]):
            self._compiled = Carry(groom.points, self._ends, self._still, self._facing, self._following)

    def carry(
        self,
        displacement: np.ndarray,
        out: np.ndarray | None = None,
        strands: slice | None = None,
        placing: Placing | None = None,
        onto: np.ndarray | None = None,
    ) -> np.ndarray:
        """The groom's own points after a deformation.

        Args:
            displacement: (N, K, 3) float32 [m], canonical axes, for the strands of the slice (all S without one).
            out: (points of these strands, 3) float32, filled and returned; allocated if left out.
            strands: a slice of consecutive strands.
            placing: where the points are put; if left out, they stay in bind-world space [m].
            onto: (P, 3) float32, all rest points as placed; points that do not move keep these bits.

        Returns:
            (points of these strands, 3) float32.

        Raises:
            ValueError: the slice has a step, or the displacement has another number of strands or vertices.
        """
        first, last, step = (strands or slice(None)).indices(self._groom.strand_count)
        if step != 1:
            raise ValueError("strands must be consecutive")
        if displacement.shape != (last - first, *self._vertices):
            raise ValueError(f"displacement {displacement.shape} for {last - first} strands")
        here = slice(self._ends[first], self._ends[last])
        onto = self._groom.points if placing is None else onto
        if out is None:
            out = np.empty((here.stop - here.start, 3), np.float32)
        onto = None if onto is None else onto[here]
        carry = self._carried if self._compiled is None else self._compiled.carry
        carry(np.asarray(displacement, np.float32), first, last, placing, onto, out)
        return out

    def _carried(self, displacement, start: int, stop: int, placing: Placing | None, onto, out: np.ndarray) -> None:
        """What `carry.c` computes: its description, and what runs where that does not."""
        points = self._groom.points[self._ends[start] : self._ends[stop]]
        displacement = np.where(self._still[start:stop, None, None], np.float32(0.0), displacement)
        if self._facing is not None:
            displacement = self._in_bind_axes(displacement)
        if self._following is None:
            moved = displacement.reshape(-1, 3)
        else:
            moved = self._following.moved(displacement, start, points)
        if onto is None:
            out[:] = times(placing.linear, (points - placing.centre) + moved) + placing.origin
            return
        if placing is not None:
            moved = times(placing.linear, moved)
        out[:] = np.where(moved == 0, onto, onto + moved)  # -0 + 0 would be +0

    def _in_bind_axes(self, vectors: np.ndarray) -> np.ndarray:
        # The inverse of a rotation: rows times R are columns times its transpose.
        return times(self._facing.T, vectors)
