# SPDX-License-Identifier: Apache-2.0
"""Locks: clusters of neighbouring roots, their mean codes, and neighbours of single vertices."""

import numpy as np

STRANDS_A_LOCK = 6
"""Locks hold at least this many strands on average; otherwise their mean codes would mean nothing."""

LOCK_SPACING = 0.012
"""Distance between neighbouring locks [m] where there are enough strands. A length, not a number of strands,
so that a groom of 120,000 strands has the same locks as the 3,000 of its strands that the network was trained on."""

COARSER = 2**0.25
"""The spacing of locks grows repeatedly by this factor until they hold enough strands."""

NEAREST, NEAR_RADIUS = 5, 0.01
"""At most NEAREST vertices adhere to each one, within NEAR_RADIUS [m]."""

MATES, MATE_RADIUS = 5, 0.02
"""At most MATES strands are tied to each one, within MATE_RADIUS [m]."""


def lock_of_roots(roots: np.ndarray) -> np.ndarray:
    """Strands belong to one lock if the same lattice point is nearest to their roots; the paper (section 3.3) leaves the clustering
    open. Clusters with a random start would all change with one strand more, in another unit, or after an edit elsewhere.

    Args:
        roots: (S, 3) [m].

    Returns:
        (S,) int32 lock of each strand, numbered without gaps from 0.
    """
    roots = np.asarray(roots, dtype=np.float64)
    spacing = LOCK_SPACING
    while True:
        point, size = _lattice_points(roots, spacing)
        if len(size) == 1 or len(roots) >= STRANDS_A_LOCK * len(size):
            break
        spacing *= COARSER
    middle = np.stack([np.bincount(point, column) / size for column in roots.T], axis=1)
    # The scalp only grazes some cells: their few strands join those around them.
    lock = _tree(middle[3 * size * len(size) >= len(roots)]).query(roots)[1]
    return np.unique(lock, return_inverse=True)[1].astype(np.int32).ravel()


def _lattice_points(places: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Which point of a face-centred cubic lattice (S,) is nearest to each place (S, 3) [m], and how many places each point has."""
    exact = places * (np.sqrt(2) / spacing)
    whole = np.round(
        exact
    )  # the lattice has points of even sum: others move along the axis where they were rounded most
    odd = np.flatnonzero(whole.sum(axis=1) % 2)
    off = exact[odd] - whole[odd]
    axis = np.abs(off).argmax(axis=1)
    whole[odd, axis] += np.where(np.take_along_axis(off, axis[:, None], 1)[:, 0] < 0, -1, 1)
    _, point, size = np.unique(whole, axis=0, return_inverse=True, return_counts=True)
    return point.ravel(), size


def lock_codes(codes: np.ndarray, lock: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Mean code of each strand's lock (z_lock of the paper, section 3.3): `lock_means`, (S, D)."""
    return lock_means(codes, lock, valid)[lock]


def lock_means(values: np.ndarray, lock: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Means over the strands of each lock.

    Args:
        values: (S, D) of each strand.
        lock: (S,) int lock of each strand.
        valid: (S,) bool, strands that count; a lock without any uses the mean over its placeholders.

    Returns:
        (L, D) float32.
    """
    weight = np.where(valid, 1.0, 1e-6)
    share = np.bincount(lock, weight)
    mean = np.stack([np.bincount(lock, weight * column) for column in np.asarray(values, np.float64).T], axis=1)
    return (mean / np.maximum(share, 1e-12)[:, None]).astype(np.float32)


def neighbours(rest: np.ndarray) -> np.ndarray:
    """The nearest vertices of other strands at rest, which adhesion keeps close.

    Args:
        rest: (S, K, 3) [m].

    Returns:
        (S, K, NEAREST) int32, index into the S K vertices, nearest first; -1 if there are fewer within NEAR_RADIUS.
    """
    strands, vertices = rest.shape[:2]
    points = np.asarray(rest, np.float64).reshape(-1, 3)
    tree = _tree(points)
    found = np.full((len(points), NEAREST), -1, np.int32)
    todo, asked = np.arange(len(points)), 2 * NEAREST + 4
    while len(todo):
        asked = min(asked, len(points))
        distance, index = tree.query(points[todo], np.arange(1, asked + 1), distance_upper_bound=NEAR_RADIUS)
        present = index < len(points)
        other = np.where(present, index, 0) // vertices
        own = todo[:, None] // vertices
        good = present & (other != own)
        first = np.argsort(~good, axis=1, kind="stable")[:, :NEAREST]
        pick = np.where(np.take_along_axis(good, first, 1), np.take_along_axis(index, first, 1), -1)
        found[todo, : pick.shape[1]] = pick
        # Again, with more candidates, for those whose list ended before the radius was reached.
        short = (good.sum(axis=1) < NEAREST) & np.isfinite(distance[:, -1])
        if asked == len(points):
            break
        todo, asked = todo[short], 4 * asked
    return found.reshape(strands, vertices, NEAREST)


def lock_mates(rest: np.ndarray, lock: np.ndarray) -> np.ndarray:
    """The strands of the same lock nearest at rest, which clumping ties together.

    Args:
        rest: (S, K, 3) [m].
        lock: (S,) int.

    Returns:
        (S, MATES) int32, by ascending mean distance along the strands; -1 if there are fewer within MATE_RADIUS.
    """
    found = np.full((len(rest), MATES), -1, np.int32)
    order = np.argsort(lock, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(lock[order])) + 1):
        if len(members) < 2:
            continue
        # In a large lock, only the strands with the nearest roots are compared along their length.
        near = _tree(rest[members, 0]).query(rest[members, 0], min(len(members), 4 * MATES))[1]
        apart = np.linalg.norm(rest[members[near]] - rest[members][:, None], axis=-1).mean(axis=-1)
        apart[members[near] == members[:, None]] = np.inf
        apart[apart > MATE_RADIUS] = np.inf
        first = np.argsort(apart, axis=1, kind="stable")[:, :MATES]
        close = np.isfinite(np.take_along_axis(apart, first, 1))
        mates = np.where(close, np.take_along_axis(members[near], first, 1), -1)
        found[members, : mates.shape[1]] = mates
    return found


def tied_together(mates: np.ndarray) -> np.ndarray:
    """Which strands (S,) int32 the ties of `mates` (S, M) join, directly or through others; numbered without gaps from 0."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    strand, column = np.nonzero(mates >= 0)
    ties = csr_array((np.ones(len(strand), bool), (strand, mates[strand, column])), shape=(len(mates),) * 2)
    return connected_components(ties, directed=False)[1].astype(np.int32)


def _tree(points: np.ndarray):
    """A search tree of points. SciPy is imported on use, since that takes longer than all other imports of running a network."""
    from scipy.spatial import cKDTree

    return cKDTree(points)
