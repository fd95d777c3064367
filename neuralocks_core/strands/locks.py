# SPDX-License-Identifier: Apache-2.0
"""Locks: clusters of neighbouring roots, what their strands share, and neighbours of single vertices."""

from __future__ import annotations

import numpy as np

STRANDS_A_LOCK = 8
"""A lock holds at least about this many strands, or its mean code says nothing."""

LOCK_SPACING = 0.012
"""Distance between neighbouring locks [m] where there are strands enough. A length, not a number of strands,
so that a groom of 120,000 strands has the same locks as the 3,000 of it that the network was trained on."""

MATES, MATE_RADIUS = 5, 0.02
"""So many strands at most are tied to each, within so many metres."""

_SAMPLE = 20_000
_ITERATIONS = 12


def lock_of_roots(roots: np.ndarray, locks: int | None = None) -> np.ndarray:
    """Cluster strands by their roots (k-means; the paper, section 3.3, leaves the clustering open).

    Args:
        roots: (S, 3) [m].
        locks: how many; if left out, by the size of the scalp and the number of strands.

    Returns:
        (S,) int32 lock of each strand, numbered without gaps from 0; always the same for the same roots.
    """
    roots = np.asarray(roots, dtype=np.float64)
    if locks is None:
        cells = len(np.unique(np.floor(roots / LOCK_SPACING).astype(np.int64), axis=0))
        locks = min(cells, -(-len(roots) // STRANDS_A_LOCK))
    random = np.random.default_rng(0)
    sample = roots if len(roots) <= _SAMPLE else roots[random.choice(len(roots), _SAMPLE, replace=False)]
    distinct = np.unique(sample, axis=0)  # a hair tie may hold many strands in one point
    centres = random.choice(distinct, min(max(locks, 1), len(distinct)), replace=False)
    for _ in range(_ITERATIONS):
        nearest = _tree(centres).query(sample)[1]
        size = np.bincount(nearest, minlength=len(centres))
        total = np.stack([np.bincount(nearest, sample[:, axis], len(centres)) for axis in range(3)], axis=1)
        centres = np.where(size[:, None] > 0, total / np.maximum(size, 1)[:, None], centres)
    lock = _tree(centres).query(roots)[1]
    return np.unique(lock, return_inverse=True)[1].astype(np.int32).ravel()


def lock_codes(codes: np.ndarray, lock: np.ndarray, valid: np.ndarray | None = None) -> np.ndarray:
    """Mean code of each strand's lock (z_lock of the paper, section 3.3): `lock_means`, (S, D)."""
    return lock_means(codes, lock, valid)[lock]


def lock_means(values: np.ndarray, lock: np.ndarray, valid: np.ndarray | None = None) -> np.ndarray:
    """Means over the strands of each lock.

    Args:
        values: (S, D) of each strand.
        lock: (S,) int lock of each strand.
        valid: (S,) bool, strands that count; a lock without any takes the mean over its placeholders.

    Returns:
        (L, D) float32.
    """
    weight = np.ones(len(lock)) if valid is None else np.where(valid, 1.0, 1e-6)
    share = np.bincount(lock, weight)
    mean = np.stack([np.bincount(lock, weight * column) for column in np.asarray(values, np.float64).T], axis=1)
    return (mean / np.maximum(share, 1e-12)[:, None]).astype(np.float32)


def neighbours(rest: np.ndarray, radius: float = 0.01, count: int = 5) -> np.ndarray:
    """The nearest vertices of other strands at rest, which adhesion keeps near.

    Args:
        rest: (S, K, 3) [m].
        radius: largest distance [m].
        count: at most this many.

    Returns:
        (S, K, count) int32, index into the S K vertices, nearest first; -1 where there are fewer.
    """
    strands, vertices = rest.shape[:2]
    points = np.asarray(rest, np.float64).reshape(-1, 3)
    tree = _tree(points)
    found = np.full((len(points), count), -1, np.int32)
    todo, asked = np.arange(len(points)), 2 * count + 4
    while len(todo):
        asked = min(asked, len(points))
        distance, index = tree.query(points[todo], np.arange(1, asked + 1), distance_upper_bound=radius)
        present = index < len(points)
        other = np.where(present, index, 0) // vertices
        own = todo[:, None] // vertices
        good = present & (other != own)
        first = np.argsort(~good, axis=1, kind="stable")[:, :count]
        pick = np.where(np.take_along_axis(good, first, 1), np.take_along_axis(index, first, 1), -1)
        found[todo, : pick.shape[1]] = pick
        # Again, with more candidates, for those whose list ended before the radius did.
        short = (good.sum(axis=1) < count) & np.isfinite(distance[:, -1])
        if asked == len(points):
            break
        todo, asked = todo[short], 4 * asked
    return found.reshape(strands, vertices, count)


def lock_mates(rest: np.ndarray, lock: np.ndarray) -> np.ndarray:
    """The strands of the same lock that lie nearest at rest, which clumping ties together.

    Args:
        rest: (S, K, 3) [m].
        lock: (S,) int.

    Returns:
        (S, MATES) int32, nearest first in the mean distance along the strands; -1 where there are fewer within MATE_RADIUS.
    """
    found = np.full((len(rest), MATES), -1, np.int32)
    order = np.argsort(lock, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(lock[order])) + 1):
        if len(members) < 2:
            continue
        # Of a large lock only the strands with the nearest roots are looked at along their length.
        near = _tree(rest[members, 0]).query(rest[members, 0], min(len(members), 4 * MATES))[1]
        apart = np.linalg.norm(rest[members[near]] - rest[members][:, None], axis=-1).mean(axis=-1)
        apart[members[near] == members[:, None]] = np.inf
        apart[apart > MATE_RADIUS] = np.inf
        first = np.argsort(apart, axis=1, kind="stable")[:, :MATES]
        close = np.isfinite(np.take_along_axis(apart, first, 1))
        mates = np.where(close, np.take_along_axis(members[near], first, 1), -1)
        found[members, : mates.shape[1]] = mates
    return found


def _tree(points: np.ndarray):
    """Points by nearness. SciPy takes longer to import than all else that a network needs to run."""
    from scipy.spatial import cKDTree

    return cKDTree(points)
