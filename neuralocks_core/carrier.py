# SPDX-License-Identifier: Apache-2.0
"""Carrying a deformation of the network's 24 vertices back to the groom's own vertices."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .arclength import arc_lengths

if TYPE_CHECKING:
    from .groom import Groom
    from .strands import StrandSet

CHUNK = 2048
"""Strands carried at a time: what is touched for them stays in the processor's second-level cache."""

_RESIDUAL_FLOOR = 2e-7
"""Own vertices nearer than this [m] to the polyline of the network's vertices count as lying on it."""


class Carrier:
    """Moves the groom's own vertices as the network's vertices move.

    An own vertex takes the displacement of the network polyline at its arc length. What separates it from
    that polyline (the turns of a coil, say) is carried along rigidly: turned by the smallest rotations that
    take the polyline's rest segments to the deformed ones. Zero displacement gives the groom's own points bit
    for bit, and strands that the network does not move (`StrandSet.valid` false) always stay.

    Args:
        groom: the groom that `strands` was made of.
        strands: its network vertices at rest.
    """

    def __init__(self, groom: Groom, strands: StrandSet) -> None:
        self._groom = groom
        self._rest = strands.rest
        self._valid = strands.valid
        self._facing = (
            None if np.array_equal(strands.facing, np.eye(3)) else strands.facing.astype(np.float32)
        )
        self._all_valid = bool(strands.valid.all())
        self._ends = np.concatenate([groom.starts, [len(groom.points)]])
        self._negative_zero = bool((np.signbit(groom.points) & (groom.points == 0)).any())

        segments = strands.rest.shape[1] - 1
        canonical = (groom.points - strands.head_origin) @ strands.facing.T
        owner = groom.strand_of_point
        self._direct = bool((groom.counts == segments + 1).all()) and bool(
            np.abs(canonical.reshape(-1, segments + 1, 3) - strands.rest)[strands.valid].max(initial=0.0)
            < 1e-6
        )
        if self._direct:
            return

        arc, length = arc_lengths(groom)
        place = arc / np.where(strands.valid, length, 1.0)[owner] * segments
        segment = np.clip(place.astype(np.int32), 0, segments - 1)
        self._weight = np.clip(place - segment, 0.0, 1.0).astype(np.float32)[:, None]
        self._segment = owner.astype(np.int32) * (segments + 1) + segment
        flat = strands.rest.reshape(-1, 3).astype(np.float64)
        on_line = flat[self._segment] * (1.0 - self._weight) + flat[self._segment + 1] * self._weight
        residual = canonical - on_line
        residual[~strands.valid[owner]] = 0.0
        # A strand that lies on the network's polyline needs no turning.
        bent = np.linalg.norm(residual, axis=1) > _RESIDUAL_FLOOR
        self._bent = np.zeros(groom.strand_count, np.bool_)
        self._bent[owner[bent]] = True
        self._residual = residual.astype(np.float32) if bent.any() else None

    def carry(
        self, displacement: np.ndarray, out: np.ndarray | None = None, strands: slice | None = None
    ) -> np.ndarray:
        """The groom's own points after a deformation.

        Args:
            displacement: (N, K, 3) float32 [m], canonical axes, for the strands of the slice (all S without
                one).
            out: (points of these strands, 3) float32, filled and returned; made if left out.
            strands: a slice of consecutive strands.

        Returns:
            (points of these strands, 3) float32 [m], bind-world space.
        """
        first, last, step = (strands or slice(None)).indices(self._groom.strand_count)
        if step != 1:
            raise ValueError("strands must be consecutive")
        if displacement.shape != (last - first, *self._rest.shape[1:]):
            raise ValueError(f"displacement {displacement.shape} for {last - first} strands")
        begin = self._ends[first]
        if out is None:
            out = np.empty((self._ends[last] - begin, 3), np.float32)
        for start in range(first, last, CHUNK):
            stop = min(start + CHUNK, last)
            part = out[self._ends[start] - begin : self._ends[stop] - begin]
            self._carry(np.asarray(displacement[start - first : stop - first], np.float32), start, stop, part)
        return out

    def _carry(self, displacement: np.ndarray, start: int, stop: int, out: np.ndarray) -> None:
        if not self._all_valid:
            displacement = np.where(self._valid[start:stop, None, None], displacement, np.float32(0.0))
        if self._direct:
            moved = displacement.reshape(-1, 3)
        else:
            moved = self._between(displacement, start, stop)
        if self._facing is not None:
            # The inverse of a rotation: rows times R are columns times its transpose.
            moved = moved @ self._facing
        own = self._groom.points[self._ends[start] : self._ends[stop]]
        np.add(own, moved, out=out)
        if self._negative_zero:  # -0 + 0 is +0: the one value that adding nothing changes
            np.copyto(out, own, where=moved == 0)

    def _between(self, displacement: np.ndarray, start: int, stop: int) -> np.ndarray:
        """(points of the strands, 3) displacement of own vertices, canonical axes."""
        here = slice(self._ends[start], self._ends[stop])
        segment = self._segment[here] - start * displacement.shape[1]
        weight = self._weight[here]
        flat = displacement.reshape(-1, 3)
        steps = np.zeros_like(displacement)
        np.subtract(displacement[:, 1:], displacement[:, :-1], out=steps[:, :-1])
        moved = flat.take(segment, axis=0)
        moved += weight * steps.reshape(-1, 3).take(segment, axis=0)
        if self._bent[start:stop].any():
            turns = _turns(self._rest[start:stop], steps).reshape(-1, 4)
            before = turns.take(segment, axis=0)
            turn = before + weight * (turns.take(segment + 1, axis=0) - before)
            axis, residual = turn[:, :3], self._residual[here]
            # A quaternion of any length turns r by 2 (w a x r + a x (a x r)) / |q|^2: nothing where a is
            # zero.
            once = _cross(axis, residual)
            twice = _cross(axis, once)
            once *= turn[:, 3:]
            once += twice
            once *= (2.0 / np.maximum(_dot(turn, turn), 1e-12))[:, None]
            moved += once
        return moved


def _turns(rest: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Smallest rotations of the segments at rest to the deformed ones, blended at each vertex.

    Blended, so that what lies off the polyline is not torn where two segments meet.

    Args:
        rest: (N, K, 3) [m].
        steps: (N, K, 3) [m], difference of displacement along each segment (last row unused).

    Returns:
        (N, K, 4) float32 quaternions x y z w, not of unit length, x y z exactly zero where nothing moved.
    """
    before = rest[:, 1:] - rest[:, :-1]
    after = before + steps[:, :-1]
    before, after = (e / np.maximum(np.sqrt(_dot(e, e)), 1e-12)[..., None] for e in (before, after))
    # Half way between no turn and twice the turn; a segment turned back onto itself has no smallest rotation.
    segment = np.empty((*before.shape[:2], 4), np.float32)
    segment[..., :3] = _cross(before, after)
    segment[..., 3] = 1.0 + _dot(before, after)
    segment /= np.sqrt(np.maximum(_dot(segment, segment), 1e-12))[..., None]
    turns = np.empty((*rest.shape[:2], 4), np.float32)
    turns[:, 0], turns[:, -1] = segment[:, 0], segment[:, -1]
    np.add(segment[:, :-1], segment[:, 1:], out=turns[:, 1:-1])
    turns[:, 1:-1] *= np.float32(0.5)
    return turns


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", a, b)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """np.cross, three times as fast on many short rows."""
    out = np.empty_like(b)
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out
