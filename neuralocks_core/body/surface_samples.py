# SPDX-License-Identifier: Apache-2.0
"""Distances to a mesh in many poses, at the same cost whether it is coarse or fine: places spread over its faces say among which of
them the nearest is.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from neuralocks_core.body.collider import closest_on_triangle, open_parts
from neuralocks_core.materials import NO_PLANE
from neuralocks_core.mesh import across, welded_vertices
from neuralocks_core.rotation import unit

AROUND = 6
"""Faces among which the nearest one is looked for."""
NEAR = 0.03
"""[m] Farther from the face of the nearest place than this, the others are looked at only if a point seems to be inside."""
WIDELY = 32
"""The same for points that seem to be inside: of thin parts, such as ears, the faces around a place may all be of the far side."""
DENSER, CLOSE = 8, 160
"""These are the first different ones of the faces at the CLOSE nearest of DENSER times as many places."""
_PLASTIC = np.array([0.7548776662466927, 0.5698402909980532])
"""Multiples of these, modulo 1, fill a square evenly (the R2 sequence)."""
_TOGETHER = 96
"""Points whose nearest places are searched together: the distances compared stay in the processor's cache, which takes a third of
the time of a tree query.
"""
_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]], bool)
"""The corners that the edges and corners of a triangle belong to, in the order of `closest_on_triangle`."""
_TOUCHING = 1e-6
"""[m] Nearer to the surface than this, its own normal is the direction away from it."""


class SurfaceSamples:
    """Places that stay where they are on the faces of a mesh, however it is posed, and the faces around each.

    Args:
        points: vertices (V, 3) [m] that tell how large the faces are.
        triangles: (F, 3), at least one.
        count: number of places. A face has them in proportion to the root of its area: large faces would take them all from an
            ear's small ones.

    Attributes:
        vertices: those of the mesh that are read (U,), however many it has: corners of the faces around places, and of the faces
            that meet there.
        faces: the triangles around each place, its own first, (count, WIDELY).
        triangles: those that are read, (f, 3) indices into `vertices`.
        open: whether a part of a triangle, in the order of `closest_on_triangle`, lies on an edge that no other of the mesh shares,
            (f, 7): across it, nothing says what is inside.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray, count: int):
        owners, shares = _spread(points, triangles, count)
        dense, there = _spread(points, triangles, DENSER * count)
        tree = cKDTree(_places(points[triangles[dense]], there))
        close = tree.query(_places(points[triangles[owners]], shares), min(CLOSE, len(dense)))[1]
        faces = np.stack([_distinct(own, near) for own, near in zip(owners, dense[close])])
        corners = welded_vertices(points)[1][triangles]
        read = np.flatnonzero(np.isin(corners, corners[np.unique(faces)]).any(axis=1))
        self.faces, self.open, self._corners = np.searchsorted(read, faces), open_parts(corners)[read], corners[read]
        self.vertices, own = np.unique(triangles[read], return_inverse=True)
        self.triangles = own.reshape(-1, 3)
        self._ring = np.argsort(self._corners, axis=None, kind="stable") // 3
        self._rings = np.searchsorted(np.sort(self._corners, axis=None), np.arange(self._corners.max() + 2))
        own = self.triangles[self.faces[:, 0]].ravel()
        self._shares = csr_array((shares.ravel(), own, 3 * np.arange(count + 1)), (count, len(self.vertices)))

    def index(self, points: np.ndarray) -> np.ndarray:
        """What `nearest` takes of `vertices` at (U, 3) [m]: x, y, z and x.x of each place, (4, count) float32. A matrix product of
        these with (-2 p, 1) finds the nearest to p.
        """
        places = (self._shares @ points).astype(np.float32)
        return np.concatenate([places.T, np.square(places).sum(axis=1)[None]])

    def planes(self, found, points: np.ndarray, vertices: np.ndarray, which=0):
        """Planes through the nearest place of the mesh, across the way there, of the faces around a place; exact distances if none
        of the others is nearer.

        Args:
            found: for each point the `nearest` place (N,).
            points: (N, 3) [m].
            vertices: where `vertices` are in several poses, (P, U, 3).
            which: the pose of each point, (N,).

        Returns:
            unit normals (N, 3) and offsets (N,) [m]: the distance of x is n.x - d.
        """
        which, face = np.broadcast_to(which, np.shape(found)), self.faces[found, 0]
        place, part = closest_on_triangle(points, *vertices[which, self.triangles[face].T])

        def look(rows: np.ndarray, among: int) -> None:
            some = self.faces[found[rows], :among]
            corners = np.moveaxis(vertices[which[rows, None, None], self.triangles[some]], 2, 0)
            places, parts = closest_on_triangle(points[rows, None], *corners)
            every, least = np.arange(len(rows)), np.square(points[rows, None] - places).sum(axis=-1).argmin(axis=1)
            place[rows], part[rows], face[rows] = places[every, least], parts[every, least], some[every, least]

        look(np.flatnonzero(np.square(points - place).sum(axis=1) < NEAR**2), AROUND)
        out = self._outward(face, part, vertices, which)
        doubted = np.flatnonzero(np.einsum("ni,ni->n", points - place, out) < 0)
        look(doubted, WIDELY)
        out[doubted] = self._outward(face[doubted], part[doubted], vertices, which[doubted])
        away = points - place
        length = np.linalg.norm(away, axis=1, keepdims=True)
        inside = np.einsum("ni,ni->n", away, out)[:, None] < 0
        away = np.where(length > _TOUCHING, np.where(inside, -away, away) / np.maximum(length, 1e-12), unit(out))
        return away, np.where(self.open[face, part], NO_PLANE[3], np.einsum("ni,ni->n", away, place))

    def _outward(self, face, part, vertices, which) -> np.ndarray:
        """Vectors (N, 3) out of the mesh at the parts (N,) of triangles (N,): the triangle's own normal within it, else the sum of
        those at its corners, where all faces around count, also those that share only the place with it, as along a texture's seams.
        """
        out = across(vertices[which[:, None], self.triangles[face]])
        row, corner = np.nonzero(_CORNERS[part])
        vertex = self._corners[face[row], corner]
        count = self._rings[vertex + 1] - self._rings[vertex]
        ends = np.cumsum(count)
        ring = self._ring[np.arange(count.sum()) + np.repeat(self._rings[vertex] - ends + count, count)]
        around = across(vertices[np.repeat(which[row], count)[:, None], self.triangles[ring]])
        if len(row):
            normals = unit(np.add.reduceat(around, ends - count))
            firsts = np.flatnonzero(np.diff(row, prepend=-1))
            out[row[firsts]] = np.add.reduceat(normals, firsts)
        return out


def nearest(index: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Which place of an `index` is nearest to each of the points (N, 3) [m], (N,) int."""
    asked, found = np.ones((len(points), 4), np.float32), np.empty(len(points), int)
    asked[:, :3] = -2 * points
    products = np.empty((_TOGETHER, index.shape[1]), np.float32)
    for first in range(0, len(points), _TOGETHER):
        some = slice(first, first + _TOGETHER)
        np.matmul(asked[some], index, out=products[: len(asked[some])]).argmin(axis=1, out=found[some])
    return found


def _spread(points: np.ndarray, triangles: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Places spread over triangles (F, 3): the triangle of each (count,), and how much of its corners it has (count, 3)."""
    room = np.cumsum(np.sqrt(np.linalg.norm(across(points[triangles]), axis=1)))
    even = (np.arange(count) + 0.5) / count
    u, v = (_PLASTIC[:, None] * np.arange(1, count + 1)) % 1
    far = np.sqrt(u)  # uniform over a triangle: Osada et al. 2002, "Shape Distributions", section 4.2
    owners = np.minimum(np.searchsorted(room, even * room[-1]), len(triangles) - 1)
    return owners, np.stack([1 - far, far * (1 - v), far * v], axis=1)


def _places(corners: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Places (n, 3) on triangles with corners (n, 3, 3), of which they have the shares (n, 3)."""
    return np.einsum("nc,nci->ni", shares, corners)


def _distinct(own: int, near: np.ndarray) -> np.ndarray:
    """The first WIDELY of the faces own and near (n,), each once; own again where there are too few."""
    found = list(dict.fromkeys([own, *near.tolist()]))[:WIDELY]
    return np.array(found + [own] * (WIDELY - len(found)))
