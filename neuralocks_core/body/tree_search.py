# SPDX-License-Identifier: Apache-2.0
"""The nearest points of a k-d tree, looked for by several threads."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.spatial import cKDTree

SHARE = 1_000
"""Points that a thread is started for at least: few are found before others have started."""


def search(tree: cKDTree, points: np.ndarray, k=1) -> tuple[np.ndarray, np.ndarray]:
    """What `tree.query(points, k)` gives of points (N, 3).

    Its own `workers` are threads that nobody waits for after Ctrl-C: they crash the process while it ends.
    """
    parts = np.array_split(points, max(1, min(os.cpu_count() or 1, len(points) // SHARE)))
    if len(parts) == 1:
        return tree.query(points, k)
    with ThreadPoolExecutor(len(parts)) as pool:
        found = list(pool.map(lambda part: tree.query(part, k), parts))
    distance, index = zip(*found, strict=True)
    return np.concatenate(distance), np.concatenate(index)
