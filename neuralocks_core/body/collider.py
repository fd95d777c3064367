# SPDX-License-Identifier: Apache-2.0
"""Signed distance from points to a triangle mesh, exact near the surface."""

from functools import cached_property

import numpy as np

from neuralocks_core.body.tree_search import search, surface_tree
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.mesh import same_vertices, welded_vertices

MOST_SAMPLES = 400_000
"""Bound on the surface samples of one mesh, so that one huge triangle cannot exhaust the memory."""
FLAT = 1e-14
"""Twice the area [m^2] up to which a triangle has none."""
CANDIDATES = 160_000
"""Triangles checked at once, for some of the points, to bound memory: a grid around a giant's head has millions."""


class Collider:
    """Distances to a mesh in one pose.

    A tree over points spread on the surface proposes triangles, and the closest point on them is exact. The search
    continues until no other triangle can be nearer. The sign is that of the angle-weighted pseudonormal
    (Baerentzen and Aanaes 2005), which is correct on edges and corners too.

    Args:
        points: (V, 3) [m].
        triangles: (F, 3) int, outward by the right-hand rule. Triangles without area are left out.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray):
        self.points = np.asarray(points, float)
        triangles = np.asarray(triangles, np.int64).reshape(-1, 3)
        if not np.isfinite(self.points).all():
            raise NeuralocksError("body: some points are not finite; repair the mesh or its animation")
        if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(self.points)):
            raise NeuralocksError("body: a triangle names a point that is not there; repair the mesh")
        a, b, c = (self.points[triangles[:, i]] for i in range(3))
        cross = np.cross(b - a, c - a)
        area = np.linalg.norm(cross, axis=1)
        kept = area > FLAT
        if not kept.any():
            raise NeuralocksError("body: its mesh has no triangle with an area; choose a surface mesh")
        self.triangles = triangles[kept]
        self._normals = cross[kept] / area[kept, None]
        samples, self._owner, self._around = _spread(a[kept], b[kept], c[kept])
        self._reach = float(self._around.max())
        self._tree = surface_tree(samples)

    def distance(self, points: np.ndarray, limit: float = 0.03, proven: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance [m] (..., ), negative inside, and the unit direction (..., 3) in which it grows fastest; zero on the
        surface where two sheets lie on each other, back to back.

        Args:
            points: (..., 3) [m].
            limit: farther outside than this [m], the distance is that to the nearest surface sample instead of the
                exact one (a few millimetres too large), which saves most of the work. Points that seem inside are
                always measured exactly.
            proven: search until no other triangle can be nearer; else only triangles around the nearest four samples are
                checked, which may miss the nearest one by a fraction of a millimetre.

        Raises:
            NeuralocksError: points are not finite (..., 3), or the limit is below 0.
        """
        distance, normal, _ = self.closest(points, limit, proven)
        return distance, normal

    def closest(self, points: np.ndarray, limit: float = 0.03, proven: bool = True):
        """Like `distance`, with the index (...,) of the nearest triangle among `triangles`."""
        if np.shape(points)[-1:] != (3,) or not np.isfinite(points).all() or not limit >= 0:
            raise NeuralocksError(
                f"points {np.shape(points)}, limit {limit}: give finite points (..., 3), a limit from 0"
            )
        shape, points = np.shape(points)[:-1], np.asarray(points, float).reshape(-1, 3)
        if not len(points):
            return np.zeros(shape), np.zeros((*shape, 3)), np.zeros(shape, int)
        rough, sample = search(self._tree, points)
        triangle = self._owner[sample]
        closest = self._tree.data[sample]
        normal = self._normals[triangle]
        # The nearest sample's face may be on the wrong side near ears and other thin parts: what seems inside is proven.
        inside = ((points - closest) * normal).sum(axis=1) < 0
        near = np.flatnonzero((rough <= limit + self._reach) | inside)
        closest, normal, triangle, best = closest.copy(), normal.copy(), triangle.copy(), np.full(len(points), np.inf)
        pending, k = near, 8 if proven else 4
        while len(pending):
            count, left = min(k, self._tree.n), []
            for here in np.split(pending, range(0, len(pending), max(1, CANDIDATES // count))[1:]):
                far, found = search(self._tree, points[here], np.arange(1, count + 1))
                # No place on the others' triangles can be nearer.
                able = far - self._around[found] <= np.minimum(rough[here], best[here])[:, None]
                able[:, 0] = True
                place, along, owner, least = self._nearest(points[here], found, able)
                nearer = least < best[here]  # what an earlier round found may not be among these
                rows = here[nearer]
                closest[rows], normal[rows], triangle[rows] = place[nearer], along[nearer], owner[nearer]
                best[rows] = least[nearer]
                done = (far[:, -1] >= best[here] + self._reach) | (count == self._tree.n) | (not proven)
                left.append(here[~done])
            pending, k = np.concatenate(left), 4 * k
        offset = points - closest
        length = np.linalg.norm(offset, axis=1)
        sign = np.where((offset * normal).sum(axis=1) < 0, -1.0, 1.0)
        # On the surface the offset has no direction: the surface's own normal takes over.
        along = sign[:, None] * offset / np.maximum(length, 1e-30)[:, None]
        direction = np.where(length[:, None] > 1e-9, along, normal)
        return (sign * length).reshape(shape), direction.reshape(*shape, 3), triangle.reshape(shape)

    def at_open_edge(self, points: np.ndarray, nearest: np.ndarray) -> np.ndarray:
        """Which of points (N, 3) [m] have an open edge of the mesh as the nearest place, with their nearest triangles (N,) as `closest`
        has them: beyond such an edge, free air is on the inner side of the face there.
        """
        feature = closest_on_triangle(points, *np.moveaxis(self.points[self.triangles[nearest]], 1, 0))[1]
        return self._open[nearest, feature]

    def _nearest(self, points: np.ndarray, samples: np.ndarray, able: np.ndarray):
        """Closest point, pseudonormal there, triangle and distance, of the triangles of those samples (N, k) that are `able`
        (N, k), of which each of the points (N, 3) has one.
        """
        row, column = np.nonzero(able)
        candidate = self._owner[samples[row, column]]
        place, feature = closest_on_triangle(points[row], *np.moveaxis(self.points[self.triangles[candidate]], 1, 0))
        squared = np.square(place - points[row]).sum(axis=1)
        least = np.minimum.reduceat(squared, np.searchsorted(row, np.arange(len(points))))
        tied = np.flatnonzero(squared == least[row])
        first = tied[np.unique(row[tied], return_index=True)[1]]
        triangle = candidate[first]
        return place[first], self._pseudonormals[triangle, feature[first]], triangle, np.sqrt(least)

    @cached_property
    def _open(self) -> np.ndarray:
        """`open_parts`; along a seam of textures, vertices are there twice."""
        return open_parts(welded_vertices(self.points)[1][self.triangles])

    @cached_property
    def _pseudonormals(self) -> np.ndarray:
        """Unit vectors (F, 7, 3): of the face, of corners 0 1 2, of edges 01 12 20. Zero where sheets lie on each other, back to back:
        beside them and beyond their rim, nothing is inside.
        """
        result = np.empty((len(self.triangles), 7, 3))
        corners = self.points[self.triangles]
        # Files have a vertex once for each side of a seam or of a hard edge, with that side's normal alone.
        triangles = same_vertices(self.points)[self.triangles]
        count = int(triangles.max()) + 1
        at_corner = np.zeros((count, 3))

        def gather(into, values, count):
            return np.stack([np.bincount(into, values[:, axis], count) for axis in range(3)], axis=1)

        for i in range(3):
            u, v = corners[:, (i + 1) % 3] - corners[:, i], corners[:, (i + 2) % 3] - corners[:, i]
            angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1))
            at_corner += gather(triangles[:, i], angle[:, None] * self._normals, count)
        result[:, 1:4] = at_corner[triangles]
        edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
        _, which = np.unique(edges[:, 0] * count + edges[:, 1], return_inverse=True)
        which = which.reshape(-1, 3)
        at_edge = gather(which.ravel(), np.repeat(self._normals, 3, axis=0), which.max() + 1)
        result[:, 4:7] = at_edge[which]
        sides = np.sort(which, axis=1)  # two of them tell all three corners
        _, which = np.unique(sides[:, 0] * len(at_edge) + sides[:, 1], return_inverse=True)
        result[:, 0] = gather(which.ravel(), self._normals, which.max() + 1)[which.ravel()]
        size = np.linalg.norm(result, axis=2, keepdims=True)
        return np.where(size > 1e-9, result, 0) / np.maximum(size, 1e-9)


def open_parts(triangles: np.ndarray) -> np.ndarray:
    """Which features of triangles (F, 3), in the order of `closest_on_triangle`, lie on an edge that no other triangle shares, (F, 7)
    bool: beyond it, nothing says what is inside. Vertices at one place must be one.
    """
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    _, which, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    single = count[which.ravel()] == 1
    corner = np.isin(triangles, edges[single])
    return np.concatenate([np.zeros((len(triangles), 1), bool), corner, single.reshape(-1, 3)], axis=1)


def closest_on_triangle(p: np.ndarray, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Closest point (..., 3) to p on triangle abc, and the feature it lies on.

    Features: 0 the face; 1, 2, 3 the corners a, b, c; 4, 5, 6 the edges ab, bc, ca. All arguments broadcast to (...,
    3). Ericson, Real-Time Collision Detection, section 5.1.5, by Voronoi regions.
    """
    ab, ac, ap, bp, cp = b - a, c - a, p - a, p - b, p - c
    d1, d2, d3, d4, d5, d6 = (
        np.einsum("...i,...i->...", u, v) for u, v in ((ab, ap), (ac, ap), (ab, bp), (ac, bp), (ab, cp), (ac, cp))
    )
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2

    def ratio(top, bottom):
        return np.where(bottom != 0, top, 0.0) / np.where(bottom != 0, bottom, 1.0)

    whole = va + vb + vc
    v, w, feature = ratio(vb, whole), ratio(vc, whole), np.zeros(va.shape, np.int8)
    # From the least to the most specific region; later ones overwrite, as the early returns of the book's order do.
    rules = (
        ((va <= 0) & (d4 - d3 >= 0) & (d5 - d6 >= 0), 5, None, ratio(d4 - d3, (d4 - d3) + (d5 - d6))),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), 6, 0.0, ratio(d2, d2 - d6)),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), 4, ratio(d1, d1 - d3), 0.0),
        ((d6 >= 0) & (d5 <= d6), 3, 0.0, 1.0),
        ((d3 >= 0) & (d4 <= d3), 2, 1.0, 0.0),
        ((d1 <= 0) & (d2 <= 0), 1, 0.0, 0.0),
    )
    for where, number, along_ab, along_ac in rules:
        along_ab = 1 - along_ac if along_ab is None else along_ab
        v, w = np.where(where, along_ab, v), np.where(where, along_ac, w)
        feature = np.where(where, np.int8(number), feature)
    return a + v[..., None] * ab + w[..., None] * ac, feature


def split_triangle(m: int) -> np.ndarray:
    """Centroids (m * m, 2), in coordinates along its sides, of the m x m congruent triangles into which a triangle is cut."""
    i, j = np.mgrid[0:m, 0:m]
    up = np.stack([i, j], axis=-1)[i + j < m] + 1 / 3
    down = np.stack([i, j], axis=-1)[i + j < m - 1] + 2 / 3
    return np.concatenate([up, down]) / m


def _spread(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points spread over triangles (n, 3), the triangle of each (n,), and how far what it stands for reaches from it (n,) [m].

    Triangles larger than most are split into m x m congruent ones, whose centroids are used.
    """
    middle = (a + b + c) / 3
    radius = np.sqrt(np.max([((corner - middle) ** 2).sum(axis=1) for corner in (a, b, c)], axis=0))
    reach = 1.5 * np.median(radius)
    while True:
        split = np.ceil(radius / reach).astype(int)
        if (split.astype(float) ** 2).sum() <= max(MOST_SAMPLES, len(a)):
            break
        reach *= 1.5
    samples, owner, around = [], [], []
    for m in np.unique(split):
        which = np.flatnonzero(split == m)
        uv = split_triangle(m)
        at = a[which, None] + uv[None, :, :1] * (b - a)[which, None] + uv[None, :, 1:] * (c - a)[which, None]
        samples.append(at.reshape(-1, 3))
        owner.append(np.repeat(which, len(uv)))
        around.append(np.repeat(radius[which] / m, len(uv)))
    return np.concatenate(samples), np.concatenate(owner), np.concatenate(around)
