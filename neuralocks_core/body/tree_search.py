# SPDX-License-Identifier: Apache-2.0
"""The nearest points of a surface: a k-d tree for them, and several threads that look."""

import os
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import numpy as np
from scipy.spatial import cKDTree

SHARE = 1_000
"""Points that a thread is started for at least: few are found before others have started."""
BLOCK = 1_000
"""Points that a thread looks for at a time: far from a dense body, thousands take a second, for which Ctrl-C would wait."""
LEAF = 32
"""Points in a leaf of the tree."""


def surface_tree(points: np.ndarray) -> cKDTree:
    """A tree of points (N, 3) on a surface, for places that may be far from it.

    Its cells are halved at their middle, and not shrunk to the points in them as SciPy's are unless told: it is made sooner, and
    finds the nearest of a place a decimetre away several times sooner. On the surface both take about the same.
    """
    return cKDTree(points, LEAF, compact_nodes=False, balanced_tree=False)


def search(tree: cKDTree, points: np.ndarray, k=1) -> tuple[np.ndarray, np.ndarray]:
    """What `tree.query(points, k)` gives of points (N, 3).

    Its own `workers` are threads that nobody waits for after Ctrl-C: they crash the process while it ends.
    """
    parts = np.array_split(points, max(1, min(os.cpu_count() or 1, len(points) // SHARE)))
    stop = Event()
    if len(parts) == 1:
        return _found(tree, points, k, stop)
    with ThreadPoolExecutor(len(parts)) as pool:
        try:
            return _joined(list(pool.map(lambda part: _found(tree, part, k, stop), parts)))
        except BaseException:
            stop.set()
            raise


def _found(tree: cKDTree, points: np.ndarray, k, stop: Event) -> tuple[np.ndarray, np.ndarray]:
    """The same block by block, only the first ones of them once `stop` is set."""
    found = []
    for block in np.split(points, range(BLOCK, len(points), BLOCK)):
        found.append(tree.query(block, k))
        if stop.is_set():
            break
    return _joined(found)


def _joined(found: list) -> tuple[np.ndarray, np.ndarray]:
    distance, index = zip(*found, strict=True)
    return np.concatenate(distance), np.concatenate(index)
