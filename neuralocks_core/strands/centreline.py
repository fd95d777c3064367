# SPDX-License-Identifier: Apache-2.0
"""The line that a curl winds around, where the curl is finer than the network's vertices."""

from __future__ import annotations

import numpy as np

SHARPEST = 0.9
"""[rad] Largest turn from one network edge to the next. A rod that turns farther at one vertex is no longer a rod: its
bending cannot be told from aliasing of turns between the samples."""

PASSES = 80


def centre_lines(points: np.ndarray) -> np.ndarray:
    """Strands smoothed just enough that no two edges meet at more than SHARPEST.

    Root and tip stay; strands without such a corner are returned bit for bit. The detail that is smoothed away, such as the
    turns of a tight coil, is carried along by `Carrier`.

    Args:
        points: (S, K, 3) [m].

    Returns:
        (S, K, 3) [m], of the same type.
    """
    return _centred(points)[0]


def passes(points: np.ndarray) -> np.ndarray:
    """How often `centre_lines` smooths each of the strands (S, K, 3), (S,) int."""
    return _centred(points)[1]


def smoothed(values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values along strands (S, K, n), smoothed `times` (S,) times: displacements of a coil become those of its line."""
    result = values.copy()
    for done in range(times.max(initial=0)):
        todo = np.flatnonzero(times > done)
        result[todo] = _once(result[todo])
    return result


def _centred(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    result, times = points.copy(), np.zeros(len(points), int)
    todo = np.flatnonzero(_sharp(points))
    for _ in range(PASSES):
        if not len(todo):
            break
        strands = _once(result[todo])
        result[todo] = strands
        times[todo] += 1
        todo = todo[_sharp(strands)]
    return result, times


def _once(strands: np.ndarray) -> np.ndarray:
    """Values along strands (S, K, n), changed in place: each moves halfway to the mean of its neighbours, except both ends."""
    strands[:, 1:-1] += 0.5 * (0.5 * (strands[:, :-2] + strands[:, 2:]) - strands[:, 1:-1])
    return strands


def _sharp(points: np.ndarray) -> np.ndarray:
    """(S,) bool: whether any corner is too sharp."""
    edges = np.diff(points, axis=1)
    length = np.linalg.norm(edges, axis=-1)
    along = np.einsum("ski,ski->sk", edges[:, :-1], edges[:, 1:])
    return (along < np.cos(SHARPEST) * length[:, :-1] * length[:, 1:]).any(axis=1)
