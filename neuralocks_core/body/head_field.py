# SPDX-License-Identifier: Apache-2.0
"""Signed distance to the head, which does not move relative to the hair: a grid, built once. Its hollows count as inside."""

import hashlib
from functools import cached_property
from threading import Lock

import numpy as np

from neuralocks_core.body.collider import Collider
from neuralocks_core.body.hollows import filled
from neuralocks_core.body.moving_skin import Skin
from neuralocks_core.sums import dot

CELL = 0.005
"""Distance between grid nodes [m]; on a head, linear interpolation is then accurate to 0.2 mm."""
ROOM = 0.03
"""How far around the head the grid reaches [m]."""
EXACT = 0.01
"""Nodes farther than this from the surface [m] hold the distance to the nearest surface sample."""
MOST_NODES = 1_000_000
"""At most: a head several times life size gets larger cells, since its features are larger. Bakes wait for the grid."""
KEPT = 128 << 20
"""Bytes of fields that are kept: one head has a field for each radius within which some of its hair reaches the body, and a crowd
asks for those of each character in turn.
"""
SAME = 7
"""Decimal places [m] to which points are rounded, to tell heads apart and to build the grid."""


def head_field(points: np.ndarray, triangles: np.ndarray, still: np.ndarray) -> "HeadField":
    """The HeadField of a mesh, built once for all grooms of a head, for copies of it placed elsewhere, and for later bakes."""
    points = np.round(points, SAME) + 0.0  # a copy that is turned differs by rounding, which also leaves negative zeros
    digest = hashlib.sha256()
    for array in (points, triangles, still):
        digest.update(np.ascontiguousarray(array).tobytes())
    key = digest.digest()
    with _keeping:
        field = _kept.get(key)
    field = field or HeadField(points, triangles, still)
    with _keeping:
        _kept.pop(key, None)
        _kept[key] = field  # behind the others: the first one is the one that was not asked for the longest
        while len(_kept) > 1 and sum(each.size for each in _kept.values()) > KEPT:
            del _kept[next(iter(_kept))]
    return field


_kept: dict[bytes, "HeadField"] = {}
"""Fields by the digest of their mesh."""
_keeping = Lock()
"""Held while `_kept` is read or changed: live hair is prepared in a thread of its own."""


class HeadField:
    """Distances around the part of a mesh that does not move, sampled on a grid.

    Args:
        points: the whole mesh in bind pose (V, 3) [m], canonical space, so that the sign is that of a closed surface.
        triangles: (F, 3).
        still: which vertices (V,) never move.

    Attributes:
        moving: triangles (M, 3) of which some vertex moves.
        values: signed distance (X, Y, Z) float32 [m] at each node, infinite where the head is not nearest.
        low: place of the first node (3,) [m].
        cell: distance between nodes [m].
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, still: np.ndarray):
        whole = Collider(points, triangles)
        fixed = still[whole.triangles].all(axis=1)
        self.moving, self._points = whole.triangles[~fixed], whole.points
        self.cell, self.low = CELL, np.zeros(3)
        self.values = np.full((2, 2, 2), np.inf, np.float32)
        if not fixed.any():
            return
        held = points[np.unique(whole.triangles[fixed])]
        self.low, high = held.min(axis=0) - ROOM, held.max(axis=0) + ROOM
        self.cell = max(CELL, float(np.cbrt(np.prod(high - self.low) / MOST_NODES)))
        size = np.ceil((high - self.low) / self.cell).astype(int) + 1
        nodes = self.low + self.cell * np.stack(np.meshgrid(*(np.arange(n) for n in size), indexing="ij"), axis=-1)
        value, _, nearest = whole.closest(nodes.reshape(-1, 3), limit=EXACT, proven=False)
        value = filled(value.reshape(size), self.cell).ravel()
        # Nodes nearest to something that moves are unknown, and so is all that is interpolated from them.
        self.values = np.where(fixed[nearest], value, np.inf).astype(np.float32).reshape(size)

    @cached_property
    def skin(self) -> Skin | None:
        """Samples of the part that moves, None if there is none. Each groom of a head needs them, too, and so does each bake."""
        if not len(self.moving):
            return None
        used, triangles = np.unique(self.moving, return_inverse=True)
        return Skin(self._points[used], triangles.reshape(-1, 3))

    @property
    def size(self) -> int:
        """Bytes of its arrays."""
        skin = vars(self).get("skin")
        return sum(
            each.nbytes for each in (self.values, self.moving, self._points, *(vars(skin).values() if skin else ()))
        )

    def near(self, reach: float) -> np.ndarray:
        """Nodes (N, 3) [m] that are inside, or less than `reach` outside."""
        return self.low + self.cell * np.argwhere(self.values < reach)

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (N,) [m] and its direction (N, 3), float32; infinite where the head is not nearest."""
        corner, (x, y, z), known = self._corners(points)
        value, direction = np.full(len(points), np.inf, np.float32), np.zeros((len(points), 3), np.float32)
        if not len(known):
            return value, direction
        at = self.values.ravel().take(corner + self._offsets).reshape(2, 2, 2, -1)
        with np.errstate(invalid="ignore"):  # infinity minus infinity: unknown, and left out below
            # Interpolated along z, then y, then x, with the slopes along each.
            along_z = at[:, :, 1] - at[:, :, 0]
            flat = at[:, :, 0] + z * along_z
            along_y = flat[:, 1] - flat[:, 0]
            line = flat[:, 0] + y * along_y
            along_x = line[1] - line[0]
            mixed = line[0] + x * along_x
            along_z = along_z[:, 0] + y * (along_z[:, 1] - along_z[:, 0])
            slope = np.empty((len(known), 3))
            slope[:, 0] = along_x
            slope[:, 1] = along_y[0] + x * (along_y[1] - along_y[0])
            slope[:, 2] = along_z[0] + x * (along_z[1] - along_z[0])
            slope /= np.maximum(np.sqrt(dot(slope, slope)), np.float32(1e-20))[:, None]
        sound = np.isfinite(mixed)
        known = known[sound]
        value[known], direction[known] = mixed[sound], slope[sound]
        return value, direction

    def rough(self, points: np.ndarray) -> np.ndarray:
        """The nearest node's distance (N,) [m]: accurate to 0.87 cells, infinite where unknown."""
        result = np.full(len(points), np.inf, np.float32)
        corner, part, known = self._corners(points)
        nearest = corner + self._strides @ (part > 0.5).astype(np.int32)
        result[known] = self.values.ravel().take(nearest)
        return result

    @cached_property
    def _strides(self) -> np.ndarray:
        size = self.values.shape
        return np.array([size[1] * size[2], size[2], 1], np.int32)

    @cached_property
    def _offsets(self) -> np.ndarray:
        """Offsets (8, 1) from the low node of a cell to its eight nodes, the last axis fastest."""
        return (np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ self._strides)[:, None]

    def _corners(self, points: np.ndarray):
        """Number of the low node of each point's cell (n,), position in it (3, n), and which points (n,) are in the grid."""
        place = np.ascontiguousarray(points.T, np.float32)
        place = place - self.low.astype(np.float32)[:, None]
        place *= np.float32(1 / self.cell)
        held = (place >= 0) & (place < self._most)
        known = (held[0] & held[1] & held[2]).nonzero()[0]
        place = place.take(known, axis=1)
        low = place.astype(np.int32)
        return self._strides @ low, place - low, known

    @cached_property
    def _most(self) -> np.ndarray:
        return np.array(self.values.shape, np.float32)[:, None] - 1
