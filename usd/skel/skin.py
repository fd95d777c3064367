# SPDX-License-Identifier: Apache-2.0
"""Distance to skin: a tree of a mesh's points, with extra points on faces so wide that hair on them is far from the corners."""

import numpy as np

from neuralocks_core.body.collider import split_triangle
from neuralocks_core.body.tree_search import surface_tree

WIDE = 0.06
"""Triangles with a side longer than this [m] are split until none is: on smaller ones most hair is within half of it of a
corner, near enough to be seen to sit there."""
MOST = 100_000
"""About this many triangles may result: one huge triangle must not fill the memory."""


class Skin:
    """One mesh, asked for its points near to others.

    Args:
        points: (V, 3) [m].
        triangles: (F, 3) int.
    """

    def __init__(self, points: np.ndarray, triangles: np.ndarray):
        more, corner = _on_wide(points, triangles)
        self._vertex = np.concatenate([np.arange(len(points)), corner, [len(points)]])
        self._tree = surface_tree(np.concatenate([points, more]))

    def query(self, points: np.ndarray, within: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Distance [m] of points (n, 3) from the skin, and the mesh's vertex there; infinity and V if it is not `within` this
        distance [m].
        """
        distance, found = self._tree.query(points, distance_upper_bound=within)
        # The tree gives the number of its points if none is near.
        return distance, self._vertex[found]


def _on_wide(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) on wide triangles, and the corner (n,) of its triangle that is nearest to each."""
    corners = points[triangles]
    side = np.sqrt(
        np.max([((corners[:, i] - corners[:, i - 1]) ** 2).sum(axis=1) for i in range(3)], axis=0, initial=0.0)
    )
    wide = np.flatnonzero(side > WIDE)
    step = max(WIDE, np.sqrt((side[wide] ** 2).sum() / MOST))
    split = np.ceil(side[wide] / step).astype(int)
    placed, vertex = [np.zeros((0, 3))], [np.zeros(0, int)]
    for m in np.unique(split):
        some, uv = wide[split == m], split_triangle(m)
        shares = np.column_stack([1 - uv.sum(axis=1), uv])
        placed.append((shares @ corners[some]).reshape(-1, 3))
        vertex.append(triangles[some][:, shares.argmax(axis=1)].ravel())
    return np.concatenate(placed), np.concatenate(vertex)
