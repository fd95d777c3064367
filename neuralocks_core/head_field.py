# SPDX-License-Identifier: Apache-2.0
"""Signed distance to a body whose head stands still: a grid for the head, made once, and a search for the rest."""

import numpy as np

from neuralocks_core.collider import Collider

CELL = 0.004
"""Distance between grid nodes [m]; on a head, linear interpolation is then right within 0.1 mm."""
ROOM = 0.03
"""How far around the head the grid reaches [m]."""
MOST_NODES = 3_000_000


class HeadField:
    """Distances around the part of a mesh that does not move, sampled on a grid.

    Args:
        points: the whole mesh in bind pose (V, 3) [m], canonical space, so that the sign is that of a closed surface.
        triangles: (F, 3).
        still: which vertices (V,) never move.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, still: np.ndarray):
        whole = Collider(points, triangles)
        fixed = still[whole.triangles].all(axis=1)
        self.moving = whole.triangles[~fixed]
        self.low, self._known = np.zeros(3), np.zeros((2, 2, 2), bool)
        self._values = np.zeros((2, 2, 2))
        self.cell = CELL
        if not fixed.any():
            return
        held = points[np.unique(whole.triangles[fixed])]
        self.low, high = held.min(axis=0) - ROOM, held.max(axis=0) + ROOM
        self.cell = max(CELL, float(np.cbrt(np.prod(high - self.low) / MOST_NODES)))
        size = np.ceil((high - self.low) / self.cell).astype(int) + 1
        nodes = self.low + self.cell * np.stack(np.meshgrid(*(np.arange(n) for n in size), indexing="ij"), axis=-1)
        # Nodes far from everything are only told apart from those inside.
        value, _, nearest = whole.closest(nodes.reshape(-1, 3), limit=0.02, proven=False)
        self._values = value.reshape(size)
        self._known = fixed[nearest].reshape(size)

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (N,) [m] and its direction (N, 3); infinite where the head is not what is nearest."""
        place = (points - self.low) / self.cell
        size = np.array(self._values.shape)
        inside = ((place >= 0) & (place < size - 1)).all(axis=1)
        result, direction = np.full(len(points), np.inf), np.zeros((len(points), 3))
        rows = np.flatnonzero(inside)
        if not len(rows):
            return result, direction
        corner = place[rows].astype(np.int32)
        part = place[rows] - corner
        strides = np.array([size[1] * size[2], size[2], 1])
        index = corner @ strides
        known = np.ones(len(rows), bool)
        eight = np.empty((2, 2, 2, len(rows)))
        for i in (0, 1):
            for j in (0, 1):
                for k in (0, 1):
                    at = index + (i * strides[0] + j * strides[1] + k)
                    eight[i, j, k] = self._values.ravel()[at]
                    known &= self._known.ravel()[at]
        x, y, z = part.T
        along = eight[1] - eight[0], eight[:, 1] - eight[:, 0], eight[:, :, 1] - eight[:, :, 0]
        face = eight[0] + x * along[0]
        line = face[0] + y * (face[1] - face[0])
        value = line[0] + z * (line[1] - line[0])
        slope = np.stack([_mixed(along[0], y, z), _mixed(along[1], x, z), _mixed(along[2], x, y)], axis=1)
        slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-12)
        result[rows] = np.where(known, value, np.inf)
        direction[rows] = slope
        return result, direction


class PosedBody:
    """The body in one pose: asked as a `Collider` is.

    Args:
        field: of the head.
        points: the whole mesh in this pose (V, 3) [m], canonical space.
    """

    def __init__(self, field: HeadField, points: np.ndarray):
        self._field = field
        self._moving = Collider(points, field.moving) if len(field.moving) else None

    def distance(self, points: np.ndarray, limit: float = 0.03, proven: bool = True):
        """As `Collider.distance`, but infinite where nothing is near."""
        shape, points = np.shape(points)[:-1], np.asarray(points, float).reshape(-1, 3)
        result, direction = self._field.distance(points)
        if self._moving is not None:
            rows = np.flatnonzero(self._moving.around(points))
            other, way = self._moving.distance(points[rows], limit, proven)
            nearer = np.abs(other) < np.abs(result[rows])
            result[rows[nearer]], direction[rows[nearer]] = other[nearer], way[nearer]
        return result.reshape(shape), direction.reshape(*shape, 3)

    def near(self, points: np.ndarray, reach: float) -> np.ndarray:
        """As `Collider.near`."""
        close = self._field.distance(points)[0] < reach + self._field.cell
        if self._moving is not None:
            close[self._moving.near(points, reach)] = True
        return np.flatnonzero(close)


def _mixed(values: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Bilinear mean of (2, 2, N)."""
    return (values[0, 0] * (1 - u) + values[1, 0] * u) * (1 - v) + (values[0, 1] * (1 - u) + values[1, 1] * u) * v
