# SPDX-License-Identifier: Apache-2.0
"""Locks are compact, the same every time, and the same size whatever the number of strands."""

import numpy as np
import pytest

from neuralocks_core.strands.locks import (
    MATE_RADIUS,
    MATES,
    NEAR_RADIUS,
    NEAREST,
    lock_codes,
    lock_mates,
    lock_of_roots,
    neighbours,
)


def scalp(strands, seed=0):
    direction = np.random.default_rng(seed).normal(size=(strands, 3))
    direction[:, 1] = np.abs(direction[:, 1])
    return 0.09 * direction / np.linalg.norm(direction, axis=1, keepdims=True)


def spread(roots, lock):
    centre = np.stack([np.bincount(lock, column) for column in roots.T], axis=1) / np.bincount(lock)[:, None]
    return np.sqrt(((roots - centre[lock]) ** 2).sum(axis=1).mean())


def test_locks_are_compact_and_gapless():
    roots = scalp(3000)
    lock = lock_of_roots(roots)
    np.testing.assert_array_equal(np.unique(lock), np.arange(lock.max() + 1))
    assert 6 < len(roots) / (lock.max() + 1) < 12
    assert spread(roots, lock) < 0.008
    np.testing.assert_array_equal(lock, lock_of_roots(roots))


def test_no_lock_is_a_few_strands_that_a_cell_of_the_lattice_grazes():
    for seed in range(3):
        size = np.bincount(lock_of_roots(scalp(20_000, seed)))
        assert size.min() > 0.3 * size.mean()


def test_lock_size_does_not_follow_the_strand_count():
    few, many = scalp(4000), scalp(60_000)
    assert spread(many, lock_of_roots(many)) == pytest.approx(spread(few, lock_of_roots(few)), rel=0.25)


def test_a_trifle_leaves_locks_as_they_are():
    """One strand less, or rounding, also along the middle, changes little; trimming only changes the neighbourhood."""
    roots = scalp(3000)
    roots[:200, 0] = 1e-9 * np.random.default_rng(1).normal(size=200)
    lock = lock_of_roots(roots)
    for changed, kept in ((roots[:-1], slice(0, -1)), (roots + 1e-8, slice(None)), (roots - 1e-8, slice(None))):
        assert shared(lock[kept], lock_of_roots(changed)) > 0.99
    trimmed = np.linalg.norm(roots - roots[500], axis=1) > 0.02
    far = np.linalg.norm(roots[trimmed] - roots[500], axis=1) > 0.05
    assert shared(lock[trimmed][far], lock_of_roots(roots[trimmed])[far]) > 0.99


def shared(one, other):
    """Mean share of a strand's lock, in either groom, that is its lock in both."""
    one, other = one[:, None] == one, other[:, None] == other
    return ((one & other).sum(axis=1) / (one | other).sum(axis=1)).mean()


@pytest.mark.parametrize("roots", [np.zeros((1, 3)), np.zeros((500, 3)), scalp(2), scalp(7)])
def test_few_or_equal_roots_make_one_lock(roots):
    np.testing.assert_array_equal(lock_of_roots(roots), 0)


def test_lock_codes_are_means_of_the_valid():
    codes = np.array([[1.0, 2.0], [3.0, 4.0], [10.0, 0.0], [99.0, 99.0]])
    lock, valid = np.array([0, 0, 1, 1]), np.array([True, True, True, False])
    np.testing.assert_allclose(lock_codes(codes, lock, valid), [[2, 3], [2, 3], [10, 0], [10, 0]], atol=1e-3)
    assert np.isfinite(lock_codes(codes, np.arange(4), np.zeros(4, bool))).all()


def test_neighbours_against_brute_force():
    random = np.random.default_rng(0)
    rest = 0.5 * scalp(60)[:, None] * np.linspace(1.0, 1.3, 24)[:, None] + random.normal(size=(60, 24, 3)) * 1e-3
    found = neighbours(rest)
    points = rest.reshape(-1, 3)
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    strand = np.arange(len(points)) // 24
    distance[strand[:, None] == strand[None]] = np.inf
    expected = np.argsort(distance, axis=1)[:, :NEAREST]
    expected = np.where(np.take_along_axis(distance, expected, 1) <= NEAR_RADIUS, expected, -1)
    assert (expected < 0).any() and (expected >= 0).any(axis=0).all()
    np.testing.assert_array_equal(found.reshape(-1, NEAREST), expected)


def test_mates_are_the_nearest_strands_of_the_lock_along_their_length():
    """Against brute force, on strands that part from each other the more the nearer their roots are."""
    rng = np.random.default_rng(5)
    roots, lock = rng.uniform(-0.01, 0.01, (18, 3)), np.arange(18) % 2
    along = np.linspace(0, 1, 24)[:, None]
    rest = roots[:, None] + along * (-3 * roots[:, None] + [0, 0.1, 0] + rng.normal(0, 0.01, (18, 1, 3)))
    apart = np.linalg.norm(rest[:, None] - rest[None], axis=-1).mean(axis=-1)
    apart[(lock[:, None] != lock) | np.eye(18, dtype=bool)] = np.inf
    order = np.argsort(apart, axis=1)[:, :MATES]
    near = np.take_along_axis(apart, order, axis=1) <= MATE_RADIUS
    np.testing.assert_array_equal(lock_mates(rest, lock), np.where(near, order, -1))
    assert near.any() and not near.all()
