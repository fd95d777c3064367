# SPDX-License-Identifier: Apache-2.0
"""Whether points lie inside a mesh that may fold into itself, or consist of parts that stand in each other."""

from functools import lru_cache

import numpy as np

from neuralocks_core.body.collider import FLAT, Collider
from neuralocks_core.mesh import across, connected_pieces
from neuralocks_core.sums import dot_apart

_DEEP = 2e-3
"""Only depths beyond this [m] are proven."""
_FEW = 8
"""Points proven at a time."""
_FEW_ENOUGH = 16
"""Up to this many points are each compared with every triangle before an index is built."""
_NOTHING = 1e-14
"""Six times the volume [m^3] up to which a part has none."""
_AT_ONCE = 200_000
"""Pairs of a point and a triangle that are held in memory at once."""


def proven_distances(vertices: np.ndarray, triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distances (N,) [m] of points (N, 3) to a mesh, as `Collider` has them, but proven where they seem deepest.

    Points in free air that `Collider` mistakes for inside seem deeper than points that are inside. So the deepest few are
    proven, and then the next few, as long as one of them turns out to be outside.

    Where closed parts stand in each other, such as an arm's end in the trunk or a head in a hat, the nearest face may be one that
    is inside the body itself. A point is as deep as it is in the part in which it is deepest.
    """
    if not len(points):
        return np.zeros(0)
    result = Collider(vertices, _in_reach(vertices, triangles, points)).distance(points)[0]
    for part in _closed_parts(np.asarray(triangles, np.int64).tobytes()):
        corners = vertices[part]
        within = ((points >= corners.min(axis=(0, 1))) & (points <= corners.max(axis=(0, 1)))).all(axis=1)
        # A line, as what a rig hides may be scaled to, encloses nothing but for rounding.
        if within.any() and _volume(corners) > _NOTHING:
            some = points[within]
            distance = Collider(vertices, _in_reach(vertices, part, some)).distance(some)[0]
            result[within] = np.minimum(result[within], np.where(distance < 0, distance, np.inf))
    deep = np.flatnonzero(result < -_DEEP)
    deep = deep[np.argsort(result[deep], kind="stable")]
    for first in range(0, len(deep), _FEW):
        some = deep[first : first + _FEW]
        air = some[~enclosed(points[some], vertices, triangles)]
        result[air] *= -1
        if not len(air):
            break
    return result


def without_air(
    distance: np.ndarray, points: np.ndarray, doubted: np.ndarray, vertices: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Signed distances (...) [m], but positive where a point is doubted and the mesh does not enclose it: beyond an open edge, as of a
    lock of mesh hair or of a head without a neck, the nearest face has free air on its inner side.

    Args:
        distance: of the points, as `Collider` has them (...).
        points: (..., 3) [m].
        doubted: which points (...) bool to look at, all with distances below 0. A sheet, such as a cape, encloses nothing: whoever is
            behind its faces should not be among them.
        vertices, triangles: of the mesh, (V, 3) [m] and (F, 3), outward.
    """
    result = np.array(distance, float)
    places, depth = points[doubted], -result[doubted]
    if len(places):
        # Points nearer to each other than to any face are on the same side of all, and proven together.
        level = np.floor(np.log2(depth))
        cells = np.floor(places / (2**level / np.sqrt(3))[:, None])
        first, which = np.unique(np.c_[level, cells], axis=0, return_index=True, return_inverse=True)[1:]
        air = ~enclosed(places[first], vertices, triangles)[which.ravel()]
        result[doubted] = np.where(air, depth, -depth)
    return result


@lru_cache(maxsize=4)  # a body has the same triangles in every frame
def _closed_parts(triangles: bytes) -> tuple[np.ndarray, ...]:
    """The parts (F', 3) of triangles (F, 3) int64 that have no open edge; none if all are one part."""
    faces = np.frombuffer(triangles, np.int64).reshape(-1, 3)
    used, places = np.unique(faces, return_inverse=True)
    places = places.reshape(-1, 3)
    piece = connected_pieces(places, len(used))[places[:, 0]]
    if not len(piece) or not piece.any():
        return ()
    ways = np.concatenate([places[:, [0, 1]], places[:, [1, 2]], places[:, [2, 0]]])
    there, back = ways @ [len(used), 1], ways @ [1, len(used)]
    open_pieces = np.unique(np.tile(piece, 3)[~np.isin(back, there)])
    return tuple(faces[piece == number] for number in np.setdiff1d(piece, open_pieces))


def _volume(corners: np.ndarray) -> float:
    """Six times what triangles (F, 3, 3) enclose; less than zero if they face inward, as those of a toon outline do."""
    a, b, c = np.moveaxis(corners - corners[0, 0], 1, 0)
    return float(np.sum(a * np.cross(b, c)))


def _in_reach(vertices: np.ndarray, triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Triangles among which the nearest one to any of the points must be, with all that share its nearest corner or edge.

    The surface is never farther than the nearest vertex, and all that touches the nearest place is equally near. Indexing a
    whole body for two points in it takes three times as long. Triangles without area are no surface: what a rig hides is scaled to
    a point, which may be nearer.
    """
    if len(points) > _FEW_ENOUGH:
        return triangles
    corners = vertices[triangles].astype(float)
    solid = _lengths(across(corners)) > FLAT
    if not solid.any():
        return triangles
    triangles, corners = triangles[solid], corners[solid]
    centres = corners.mean(axis=1)
    radii = _lengths(corners - centres[:, None]).max(axis=1)
    kept = np.zeros(len(triangles), bool)
    for point in points:
        nearest = _lengths(corners - point).min()
        kept |= _lengths(centres - point) - radii < 1.001 * nearest + 1e-6
    return triangles[kept]


def enclosed(points: np.ndarray, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Which points (N,) of (N, 3) a mesh of vertices (V, 3) and outward triangles (F, 3) encloses by more than half.

    The winding number, a sum of solid angles (Van Oosterom and Strackee 1983), stays valid where the surface intersects
    itself, as skin does in the crease of a bent neck: there the nearest face may point either way, and a point in free air a
    hand's breadth away from it seems just as deep inside. A hole counts by the solid angle that it covers.
    """
    inside = np.zeros(len(points), bool)
    used, corners = np.unique(triangles, return_inverse=True)
    places, corners = vertices[used].T.astype(float), corners.reshape(-1, 3).T
    step = max(1, _AT_ONCE // max(len(triangles), 1))
    for first in range(0, len(points), step):
        away = places[:, None] - points[first : first + step].T[:, :, None]
        far = np.sqrt(dot_apart(away, away))
        (a, la), (b, lb), (c, lc) = ((away.take(corner, axis=2), far.take(corner, axis=1)) for corner in corners)
        volume = dot_apart(
            a, np.stack([b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]])
        )
        spread = la * lb * lc + dot_apart(a, b) * lc + dot_apart(b, c) * la + dot_apart(c, a) * lb
        inside[first : first + step] = 2 * np.arctan2(volume, spread).sum(axis=1) > 2 * np.pi
    return inside


def _lengths(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
