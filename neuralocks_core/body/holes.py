# SPDX-License-Identifier: Apache-2.0
"""Closing the holes of a head: many avatars have no scalp below their hair, and hair that sinks into the head there meets nothing."""

import numpy as np

from neuralocks_core.mesh import across, connected_pieces, welded_vertices

LARGEST = 0.25
"""A hole is closed if it is smaller than this share of its part's surface: an eyebrow or a ribbon is all rim."""
DOWN = -0.5
"""Sine of how steeply a hole may face down: through that of a hat comes the head, through that of a head the neck."""


def closed_holes(points: np.ndarray, triangles: np.ndarray, head: np.ndarray) -> np.ndarray:
    """Triangles (F', 3) that close the holes of a head, none of whose vertices they add, so that they move with it.

    Args:
        points: (V, 3) [m], y up.
        triangles: (F, 3), outward.
        head: which vertices are the head's, (V,) bool: holes with others on the rim, such as collars and sleeves, are open for
            what is in them.
    """
    place = welded_vertices(points)[1]
    ways = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    there, back = place[ways] @ [len(points), 1], np.sort(place[ways] @ [1, len(points)])
    rim = ways[back[np.minimum(np.searchsorted(back, there), len(back) - 1)] != there]
    lids = [_lid(loop) for loop in _loops(rim, place) if head[loop].all()]
    if not lids:
        return np.zeros((0, 3), int)
    piece = connected_pieces(place[triangles], len(points))[place]
    room = np.bincount(piece[triangles[:, 0]], np.linalg.norm(across(points[triangles]), axis=1), piece.max() + 1)
    every, firsts = np.concatenate(lids), np.cumsum([0] + [len(lid) for lid in lids[:-1]])
    areas = across(points[every])
    size, whole = np.linalg.norm(areas, axis=1), np.add.reduceat(areas, firsts)
    small = np.add.reduceat(size, firsts) < LARGEST * room[piece[every[firsts, 0]]]
    kept = small & (whole[:, 1] > DOWN * np.linalg.norm(whole, axis=1))
    return every[np.repeat(kept, [len(lid) for lid in lids])]


def _loops(rim: np.ndarray, place: np.ndarray) -> list[np.ndarray]:
    """Vertices, one after another, of each closed loop of directed edges (n, 2); edges that branch are in none."""
    start, end = place[rim].T
    plain = (np.bincount(start)[start] == 1) & (np.bincount(end)[end] == 1)
    follows = {int(a): (int(b), vertex) for a, b, vertex in zip(start[plain], end[plain], rim[plain, 0])}
    loops = []
    for first in list(follows):
        at, loop = first, []
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
