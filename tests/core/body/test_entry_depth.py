# SPDX-License-Identifier: Apache-2.0
"""Depths below skin of which nothing is known are told from free air by the strand that leads there."""

import numpy as np
import pytest

from neuralocks_core.body.entry_depth import depths_along

KNOWN = 0.03
"""Distances are known this far to both sides of the skin [m]."""


def measured(points):
    """Distances (K, n) to the ground and their directions (K, 3, n), as far as they are known, of points (K, 3, n)."""
    height = points[:, 1].copy()
    far = np.abs(height) > KNOWN
    way = np.where(far[:, None], 0.0, np.array([0.0, 1.0, 0.0])[:, None])
    return np.where(far, np.inf, height), way


def strand(heights):
    """Points (K, 3, 1) [m] of a strand with these heights [m] over the ground."""
    points = np.zeros((len(heights), 3, 1))
    points[:, 0, 0], points[:, 1, 0] = 0.01 * np.arange(len(heights)), heights
    return points


@pytest.mark.parametrize(
    "heights",
    [
        [0.01, -0.02, -0.04, -0.06, -0.05, -0.01, 0.02],
        [0.01, -0.02, -0.04, -0.06],
        [-0.08, -0.05, -0.02, 0.02, 0.06],
        [0.05, 0.02, -0.01, -0.05, -0.02, 0.01, 0.05, 0.02, -0.02, -0.05],
    ],
    ids=["in and out", "in", "out", "twice"],
)
def test_the_skin_that_a_strand_goes_through_says_how_deep_it_lies(heights):
    points = strand(heights)
    distance, way = measured(points)
    depths_along(points, distance, way)
    height = np.array(heights)
    np.testing.assert_allclose(distance[:, 0], np.where(height > KNOWN, np.inf, height), atol=1e-12)
    np.testing.assert_array_equal(way[:, 1, 0], height <= KNOWN)


def test_hair_far_outside_is_left_unknown():
    points = np.concatenate([strand([0.0, 0.02, 0.05, 0.08, 0.05, 0.02]), strand([0.05] * 6)], axis=2)
    distance, way = measured(points)
    before = distance.copy(), way.copy()
    depths_along(points, distance, way)
    np.testing.assert_array_equal(distance, before[0])
    np.testing.assert_array_equal(way, before[1])


def test_a_strand_does_not_depend_on_those_beside_it():
    rng = np.random.default_rng(0)
    points = np.concatenate([strand(np.cumsum(rng.normal(0, 0.02, 12))) for _ in range(50)], axis=2)
    distance, way = measured(points)
    depths_along(points, distance, way)
    for i in range(50):
        alone, out = measured(points[:, :, i : i + 1])
        depths_along(points[:, :, i : i + 1], alone, out)
        np.testing.assert_array_equal(alone[:, 0], distance[:, i])
        np.testing.assert_array_equal(out[:, :, 0], way[:, :, i])
    assert np.isfinite(distance).sum() > np.isfinite(measured(points)[0]).sum()


def test_of_two_planes_that_reach_a_vertex_the_nearer_is_its_way_out():
    """Under a ridge, a strand goes in by a gentle slope and out by a steep one: what is right below the steep one leaves through
    it.
    """
    points = strand([-0.02, -0.05, -0.05, -0.05, -0.02])
    distance, way = np.full((5, 1), np.inf), np.zeros((5, 3, 1))
    distance[0], distance[4] = -0.02, -0.02
    way[0, 1], way[4, 0] = 1, 1
    depths_along(points, distance, way)
    np.testing.assert_allclose(distance[:, 0], [-0.02, -0.05, -0.04, -0.03, -0.02], atol=1e-12)
    np.testing.assert_array_equal(way[1:4, :, 0], [[0, 1, 0], [1, 0, 0], [1, 0, 0]])
