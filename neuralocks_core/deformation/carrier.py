# SPDX-License-Identifier: Apache-2.0
"""Transfers a deformation of the network's 24 vertices to the groom's own, and these to where they are shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from neuralocks_core.deformation.following import Following
from neuralocks_core.deformation.scratch import Scratch, in_turn
from neuralocks_core.strands.arclength import arc_lengths

if TYPE_CHECKING:
    from neuralocks_core.groom import Groom
    from neuralocks_core.strands.strand_set import StrandSet

POINTS = 16384
"""Approximate number of points carried at a time: their data stays in the processor's second-level cache."""

BLOCK = 512
"""Strands prepared together, so that preparation needs little memory besides its result; also the most carried at once."""

_scratch = Scratch()


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
        self._still = None if strands.valid.all() else ~strands.valid
        self._facing = None if np.array_equal(strands.facing, np.eye(3)) else strands.facing.astype(np.float32)
        self._ends = np.concatenate([groom.starts, [len(groom.points)]])
        self._negative_zero = bool((np.signbit(groom.points) & (groom.points == 0)).any())

        # A power of two, so that no chunk reaches across a border of BLOCK.
        each = POINTS * groom.strand_count / max(len(groom.points), 1)
        self._chunk = 2 ** int(np.clip(np.log2(max(each, 1.0)), 4, np.log2(BLOCK)))
        rest = strands.rest if self._facing is None else self._in_bind_axes(strands.rest)
        own = groom.points - strands.head_origin
        direct = bool((groom.counts == len(rest[0])).all()) and bool(
            np.abs(own.reshape(rest.shape) - rest)[strands.valid].max(initial=0.0) < 1e-6
        )
        self._blocks = [] if direct else self._followed(rest, own, strands)

    def _followed(self, rest: np.ndarray, own: np.ndarray, strands: StrandSet) -> list:
        """How each block's own vertices follow the network's."""
        groom, count = self._groom, len(rest)
        arc, length = arc_lengths(groom)
        place = arc / np.where(strands.valid, length, 1.0)[groom.strand_of_point] * (self._vertices[0] - 1)
        blocks = []
        for low in range(0, count, BLOCK):
            some = slice(low, min(low + BLOCK, count))
            here = slice(self._ends[low], self._ends[some.stop])
            blocks.append(Following(rest[some], strands.valid[some], own[here], groom.counts[some], place[here]))
        return blocks

    def _in_bind_axes(self, vectors: np.ndarray) -> np.ndarray:
        # The inverse of a rotation: rows times R are columns times its transpose. All rows at once: one product for each
        # strand's few takes twice as long.
        return (vectors.reshape(-1, 3) @ self._facing).reshape(vectors.shape)

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
        begin = self._ends[first]
        onto = self._groom.points if placing is None else onto
        if out is None:
            out = np.empty((self._ends[last] - begin, 3), np.float32)
        start = first
        while start < last:
            stop = min(start - start % self._chunk + self._chunk, last)
            here = slice(self._ends[start], self._ends[stop])
            some = np.asarray(displacement[start - first : stop - first], np.float32)
            part = out[here.start - begin : here.stop - begin]
            self._carried(some, start, stop, part, placing, None if onto is None else onto[here])
            start = stop
        return out

    def _carried(self, displacement, start, stop, out, placing, onto) -> None:
        """`carry` of one chunk, in arrays whose coordinates come first."""
        if self._still is not None:
            displacement = np.where(self._still[start:stop, None, None], np.float32(0.0), displacement)
        rest = self._groom.points[self._ends[start] : self._ends[stop]]
        if onto is None and not self._blocks:
            self._carried_at_once(displacement, rest, out, placing)
            return
        if self._facing is not None:
            displacement = self._in_bind_axes(displacement)
        block = self._blocks[start // BLOCK] if self._blocks else None
        columns = block.columns if block else np.transpose
        (points,) = _scratch.arrays(columns(rest).shape)
        across = (3, *[1] * (points.ndim - 1))
        if onto is None:
            np.subtract(columns(rest), placing.centre.reshape(across), out=points)
        else:
            points[:] = columns(rest)
        moved = block.moved(displacement, start % BLOCK, points) if block else displacement.reshape(-1, 3).T
        if onto is None:
            points += moved
            np.add(_placed(placing.linear, points), placing.origin.reshape(across), out=columns(out))
            return
        if placing is not None:
            moved = _placed(placing.linear, moved)
        np.add(columns(onto), moved, out=columns(out))
        if self._negative_zero:  # -0 + 0 is +0: the only value that adding zero changes
            np.copyto(columns(out), columns(onto), where=moved == 0)

    def _carried_at_once(self, displacement, rest, out, placing) -> None:
        """`_carried` if the groom's vertices are the network's: placed and turned from the network's axes in one step."""
        both, result = in_turn.arrays((6, len(rest)), (3, len(rest)))
        np.subtract(rest.T, placing.centre[:, None], out=both[:3])
        both[3:] = displacement.reshape(-1, 3).T
        turned = placing.linear if self._facing is None else placing.linear @ self._facing.T
        np.matmul(np.hstack([placing.linear, turned]), both, out=result)
        np.add(result, placing.origin[:, None], out=out.T)


def _placed(matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """A matrix (3, 3) times vectors (3, ...); valid until this thread's next step."""
    (result,) = in_turn.arrays(vectors.shape)
    np.matmul(matrix, vectors.reshape(3, -1), out=result.reshape(3, -1))
    return result
