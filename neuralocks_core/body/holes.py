# SPDX-License-Identifier: Apache-2.0
"""Closing the holes of a body's surface: many avatars have no scalp below their hair, and hair that sinks into the head there meets
nothing.
"""

import numpy as np

from neuralocks_core.mesh import welded_pieces, welded_vertices

LARGEST = 0.25
"""A hole is closed if it is smaller than this share of its part's surface: an eyebrow, a ribbon or a skirt is all rim."""


def closed_holes(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Triangles (F', 3) that close the holes of a mesh, none of whose vertices they add, so that they move with it.

    Args:
        points: (V, 3) [m].
        triangles: (F, 3), outward.
    """
    place = welded_vertices(points)[1]
    ways = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    there, back = place[ways] @ [len(points), 1], place[ways] @ [1, len(points)]
    rim = ways[~np.isin(there, back)]
    if not len(rim):
        return np.zeros((0, 3), int)
    piece = welded_pieces(points, triangles)
    room = np.bincount(piece[triangles[:, 0]], _areas(points, triangles), piece.max() + 1)
    lids = [_lid(loop) for loop in _loops(rim, place)]
    kept = [lid for lid in lids if _areas(points, lid).sum() < LARGEST * room[piece[lid[0, 0]]]]
    return np.concatenate(kept) if kept else np.zeros((0, 3), int)


def _loops(rim: np.ndarray, place: np.ndarray) -> list[np.ndarray]:
    """Vertices, one after another, of each closed loop of directed edges (n, 2); edges that branch are in none."""
    start, end = place[rim].T
    plain = (np.bincount(start)[start] == 1) & (np.bincount(end)[end] == 1)
    follows = {int(a): (int(b), vertex) for a, b, vertex in zip(start[plain], end[plain], rim[plain, 0])}
    loops = []
    while follows:
        first = at = next(iter(follows))
        loop = []
        while at in follows:
            at, vertex = follows.pop(at)
            loop.append(vertex)
        if at == first and len(loop) > 2:
            loops.append(np.array(loop))
    return loops


def _lid(loop: np.ndarray) -> np.ndarray:
    """Triangles (n - 2, 3) over a loop of n vertices, in a strip from side to side, which face as the mesh around does."""
    order = np.empty(len(loop), int)
    order[0::2], order[1::2] = loop[: (len(loop) + 1) // 2], loop[(len(loop) + 1) // 2 :][::-1]
    strip = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
    strip[1::2] = strip[1::2, [1, 0, 2]]
    return strip


def _areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = points[triangles.T]
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
