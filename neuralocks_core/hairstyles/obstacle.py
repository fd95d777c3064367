# SPDX-License-Identifier: Apache-2.0
"""What hair must not grow into: signed distance to head, neck and shoulders, on a grid for fast lookup."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import ndimage

from neuralocks_core.body.tree_search import search, surface_tree
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.hairstyles.scalp import Scalp
from neuralocks_core.mesh import across, vertex_normals

_CELL = 0.08
"""Grid spacing in head radii (7 mm on an adult)."""

_CHUNK = 8192


class Obstacle:
    """Signed distance around the head, sampled on a grid once and interpolated linearly.

    Args:
        scalp: gives the head's place and size.
        body: points (V, 3) [m] and triangles (F, 3) of the body or head in bind space; without one, a head,
            neck and shoulders of typical proportions take its place.
    """

    def __init__(self, scalp: Scalp, body: tuple[np.ndarray, np.ndarray] | None = None) -> None:
        self._low, self._step, axes = _grid(scalp.radius, scalp.head_centre)
        self._shape = np.array([len(axis) for axis in axes])
        if body is None:
            distance = _stand_in(_nodes(axes), scalp)
        else:
            points, triangles = np.asarray(body[0], np.float64), np.asarray(body[1], np.int64)
            centre = tuple(map(float, scalp.head_centre))
            distance = _distances(float(scalp.radius), centre, points.tobytes(), triangles.tobytes())
        field = _without_pockets(distance.reshape(self._shape), self._step)
        slope = np.stack(np.gradient(field, self._step), axis=-1)
        self._field = np.concatenate([field[..., None], slope], axis=-1).astype(np.float32).reshape(-1, 4)

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance [m] (N,), negative inside, and the unit direction out (N, 3).

        Args:
            points: (N, 3) [m]; outside the grid the nearest value on its border is taken.
        """
        distance, out = np.empty(len(points), np.float32), np.empty((len(points), 3), np.float32)
        for start in range(0, len(points), _CHUNK):  # only as many at a time as the cache holds
            part = slice(start, start + _CHUNK)
            distance[part], out[part] = self._distance(points[part])
        return distance, out

    def _distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = (points - self._low) / self._step
        at = np.clip(at, 0.0, self._shape - 1.001).astype(np.float32)
        cell = at.astype(np.int64)
        part = at - cell
        stride = np.array([self._shape[1] * self._shape[2], self._shape[2], 1])
        first = cell @ stride
        total = np.zeros((len(points), 4), np.float32)
        for corner in np.ndindex(2, 2, 2):
            weight = np.ones(len(points), np.float32)
            for axis, upper in enumerate(corner):
                weight *= part[:, axis] if upper else 1 - part[:, axis]
            total += weight[:, None] * self._field.take(first + corner @ stride, axis=0)
        slope = total[:, 1:]
        return total[:, 0], slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-6)

    def push_out(self, points: np.ndarray, margin: np.ndarray | float) -> np.ndarray:
        """Points (N, 3) moved to at least `margin` [m] (N,) from the surface, along the way out."""
        distance, out = self.distance(points)
        return points + np.maximum(margin - distance, 0.0)[:, None] * out


def _grid(radius: float, centre: np.ndarray) -> tuple[np.ndarray, float, list[np.ndarray]]:
    """Low corner (3,) of a grid around a head, its spacing, and the places of its nodes along x, y and z, all in [m]."""
    low, step = centre - radius * np.array([3.2, 7.0, 3.0]), _CELL * radius
    high = centre + radius * np.array([3.2, 2.2, 3.0])
    return low, step, [np.arange(a, b, step) for a, b in zip(low, high, strict=True)]


def _nodes(axes: list[np.ndarray]) -> np.ndarray:
    """All nodes (N, 3) of a grid."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


@lru_cache(maxsize=2)  # a second style on the same head takes a fraction of the time of the first
def _distances(radius: float, centre: tuple[float, ...], points: bytes, triangles: bytes) -> np.ndarray:
    """`_to_surface` of the nodes of a head's grid."""
    nodes = _nodes(_grid(radius, np.array(centre))[-1])
    return _to_surface(nodes, np.frombuffer(points).reshape(-1, 3), np.frombuffer(triangles, np.int64).reshape(-1, 3))


def _to_surface(grid: np.ndarray, points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(N,) signed distance to a mesh from its nearest corner or face centre.

    Near the surface, it is the distance to the sample's tangent plane. This is coarser than `collider.Collider` but many
    times faster; grown hair keeps some millimetres away.
    """
    if not len(triangles) or triangles.min() < 0 or triangles.max() >= len(points) or not np.isfinite(points).all():
        raise NeuralocksError("body: is not a triangle mesh of finite points; repair the mesh")
    corners = points[triangles]
    a, b, c = corners.swapaxes(0, 1)
    face = across(corners)
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-30)
    used = np.unique(triangles)
    sample = np.concatenate([points[used], (a + b + c) / 3])
    normal = np.concatenate([vertex_normals(points, triangles)[used], face])
    low, high = grid.min(axis=0) - 0.1, grid.max(axis=0) + 0.1
    inside = ((sample > low) & (sample < high)).all(axis=1)
    if not inside.any():
        raise NeuralocksError("body: none of its mesh lies near the scalp; give both in the same space")
    sample, normal = sample[inside], normal[inside]
    distance, nearest = search(surface_tree(sample), grid)
    plane = ((grid - sample[nearest]) * normal[nearest]).sum(axis=1)
    flat = np.clip(2.0 - distance / 0.006, 0.0, 1.0)  # the plane's up to 6 mm, the sample's beyond 12 mm
    return np.where(plane < 0, -1.0, 1.0) * (flat * np.abs(plane) + (1 - flat) * distance)


def _without_pockets(field: np.ndarray, step: float) -> np.ndarray:
    """Signed distances on a grid with spacing `step` [m], in which space that is sealed off from outside counts as inside.

    Heads have eyes and a mouth modelled into them; without this, a strand that once got in would find room there.
    `body.hollows` is for a finer grid, and moves skin around its hollows a little, so hair would grow differently.
    """
    regions, count = ndimage.label(field > 0.5 * step)  # lips and lids are slightly open
    if count < 2:
        return field
    outside = regions == 1 + np.argmax(np.bincount(regions.ravel())[1:])
    outside = ndimage.binary_dilation(outside, iterations=2, mask=field > 0)
    depth = step * (ndimage.distance_transform_edt(~outside) - 1)  # at most the true depth: up to one cell more is skin
    return np.where(outside, field, np.minimum(field, -depth))


def _stand_in(points: np.ndarray, scalp: Scalp) -> np.ndarray:
    """(N,) approximate signed distance to an ellipsoid head fitted to the scalp, a neck and shoulders."""
    radius = scalp.radius
    p = points - scalp.head_centre
    own = scalp.points[np.unique(scalp.triangles)] - scalp.head_centre
    # Semi-axes that put the scalp's points on the ellipsoid in the least-squares sense.
    inverse = np.linalg.lstsq(own**2, np.ones(len(own)), rcond=None)[0]
    axes = np.where(inverse > 0, 1 / np.sqrt(np.maximum(inverse, 1e-9)), radius).clip(0.7 * radius, 1.4 * radius)
    scaled = np.linalg.norm(p / axes, axis=1)
    head = scaled * (scaled - 1) / np.maximum(np.linalg.norm(p / axes**2, axis=1), 1e-9)
    head = np.where(scaled < 0.3, -0.7 * radius, head)
    neck = _capsule(p, [0, -0.5 * radius, -0.1 * radius], [0, -2.4 * radius, -0.4 * radius], 0.52 * radius)
    shoulders = _capsule(
        p,
        [-1.6 * radius, -3.0 * radius, -0.4 * radius],
        [1.6 * radius, -3.0 * radius, -0.4 * radius],
        0.6 * radius,
    )
    trunk = _capsule(p, [0, -3.4 * radius, -0.2 * radius], [0, -8 * radius, -0.2 * radius], 1.1 * radius)
    return np.minimum(np.minimum(head, neck), np.minimum(shoulders, trunk))


def _capsule(p: np.ndarray, a: list[float], b: list[float], radius: float) -> np.ndarray:
    a, along = np.asarray(a), np.asarray(b) - np.asarray(a)
    share = np.clip((p - a) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(p - a - share[:, None] * along, axis=1) - radius
