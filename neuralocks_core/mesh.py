# SPDX-License-Identifier: Apache-2.0
"""What the faces of a mesh tell: vertex normals, connected parts, and which side is outside."""

import numpy as np

from neuralocks_core.rotation import unit

INSIDE_OUT = -0.3
"""Volumes that triangles span with the middle of the mesh: their sum over the sum of their sizes. 1 for a ball, 0.5 for a person
with arms spread, near 0 for hair cards and cloth, whose sides mean nothing. Below this value the mesh is inside out."""
WELDED = 1e-4
"""Points this close [m] count as one: files split a skin along texture seams and between meshes."""
SAME = 1e-7
"""Points this close [m] are the same one, apart from rounding."""
_MIXED = np.array([1, -7046029254386353131, 1609587929392839161])
"""Odd numbers whose multiples, modulo 2^64, give different places different integers, but for one pair in about 2^64."""


def across(corners: np.ndarray) -> np.ndarray:
    """Normals (n, 3), as long as twice the area, of triangles with corners (n, 3, 3)."""
    x, y, z = np.moveaxis(corners, 2, 0)
    (ux, vx), (uy, vy), (uz, vz) = ((c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]) for c in (x, y, z))
    return np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], axis=1)


def vertex_normals(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals (V, 3) of points (V, 3), outward like the triangles (F, 3), by the right-hand rule.

    Each is the mean of the faces around, weighted by their area; zero if there is none.
    """
    face, corners = across(np.asarray(points, float)[triangles]), triangles.T.ravel()
    total = np.stack([np.bincount(corners, np.tile(part, 3), len(points)) for part in face.T], axis=1)
    return unit(total)


def connected_pieces(faces: np.ndarray, count: int) -> np.ndarray:
    """Number of the piece that each of `count` vertices is in (V,) int; faces (F, n) have n corners each."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first, second = faces[:, :-1].ravel(), faces[:, 1:].ravel()
    links = coo_array((np.ones(len(first), bool), (first, second)), (count, count))
    return connected_components(links, directed=False)[1]


def welded_pieces(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """The same for points (V, 3) [m] and triangles (F, 3), with points `WELDED` where they meet."""
    place = welded_vertices(points)[1]
    return connected_pieces(place[triangles], len(points))[place]


def welded_vertices(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first point (W,) of each place where points (V, 3) [m] lie, and the place of each of them (V,), 0 to W - 1."""
    # One integer per place: many times faster to sort than triples, and unique within 100 m.
    with np.errstate(invalid="ignore"):  # a point light years away fits no integer
        lattice = np.round(points / WELDED).astype(np.int64) @ np.array([1, 1 << 21, 1 << 42])
    return np.unique(lattice, return_index=True, return_inverse=True)[1:]


def same_vertices(points: np.ndarray) -> np.ndarray:
    """The place (V,) of each of points (V, 3) [m], from 0 on, which it shares only with the `SAME`: the two sides of thin cloth, which
    `welded_vertices` may join, stay apart.
    """
    with np.errstate(invalid="ignore"):
        lattice = np.round(points / SAME).astype(np.int64) @ _MIXED
    return np.unique(lattice, return_inverse=True)[1]


def rays_through(
    points: np.ndarray, triangles: np.ndarray, start: np.ndarray, ways: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the rays from a point (3,) along unit vectors `ways` (R, 3) pass through triangles (F, 3) of points (V, 3).

    Returns:
        indices (H,) of ray and triangle, and the distance (H,) from the start.
    """
    # A ray passes through a triangle if it sees all three of its edges on the same side.
    a, b, c = (np.asarray(points, float)[corner] - start for corner in triangles.T)
    sides = np.stack([ways @ np.cross(p, q).T for p, q in ((a, b), (b, c), (c, a))])
    ahead = ways @ (a + b + c).T > 0
    ray, triangle = np.nonzero(ahead & ((sides > 0).all(axis=0) | (sides < 0).all(axis=0)))
    normal = np.cross(b - a, c - a)[triangle]
    return ray, triangle, (a[triangle] * normal).sum(axis=1) / (ways[ray] * normal).sum(axis=1)


def inside_out(points: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether the triangles (F, 3) of a mesh's points (V, 3) face inward.

    In some files every triangle does, and hair would be pushed into such a body.
    """
    if not len(triangles):
        return False
    points, corners = np.asarray(points, float), np.ascontiguousarray(triangles.T)
    middle = np.bincount(corners.ravel(), minlength=len(points)) @ points / corners.size
    # One array for each coordinate: gathering triples takes several times as long.
    x, y, z = np.ascontiguousarray((points - middle).T)[:, corners]
    spanned = sum(p[0] * (q[1] * r[2] - q[2] * r[1]) for p, q, r in ((x, y, z), (y, z, x), (z, x, y)))
    return bool(spanned.sum() < INSIDE_OUT * np.abs(spanned).sum())
