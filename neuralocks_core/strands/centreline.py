# SPDX-License-Identifier: Apache-2.0
"""The line that a curl winds around, where the curl is finer than the network's vertices."""

from __future__ import annotations

import numpy as np

SHARPEST = 0.9
"""[rad] Largest turn from one network edge to the next. A rod that turns farther in one vertex is no rod any more: its
bending cannot be told from aliasing of turns between the samples."""

PASSES = 80


def centre_lines(points: np.ndarray) -> np.ndarray:
    """Strands smoothed just so far that no two edges meet at more than SHARPEST.

    Root and tip stay; strands without such a corner come back bit for bit. What is smoothed away, the turns of a tight
    coil, is carried along by `Carrier`.

    Args:
        points: (S, K, 3) [m].

    Returns:
        (S, K, 3) [m], of the same type.
    """
    result = points.copy()
    todo = np.flatnonzero(_sharp(points))
    for _ in range(PASSES):
        if not len(todo):
            break
        strands = result[todo]
        strands[:, 1:-1] += 0.5 * (0.5 * (strands[:, :-2] + strands[:, 2:]) - strands[:, 1:-1])
        result[todo] = strands
        todo = todo[_sharp(strands)]
    return result


def _sharp(points: np.ndarray) -> np.ndarray:
    """(S,) bool: whether any corner is too sharp."""
    edges = np.diff(points, axis=1)
    length = np.linalg.norm(edges, axis=-1)
    along = np.einsum("ski,ski->sk", edges[:, :-1], edges[:, 1:])
    return (along < np.cos(SHARPEST) * length[:, :-1] * length[:, 1:]).any(axis=1)
