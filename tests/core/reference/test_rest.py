# SPDX-License-Identifier: Apache-2.0
"""What is measured of strands at rest, by hand, and which strands are refused."""

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.reference.rest import rest_rods

CORNER = np.array([[0, 0, 0], [0, 0.02, 0], [0, 0.02, 0.03], [0.05, 0.02, 0.03]])
"""Edges of 2, 3 and 5 cm, up, ahead and aside, each at a right angle to the one before."""


def test_a_strand_of_uneven_edges_is_measured():
    rods = rest_rods(CORNER[None])
    np.testing.assert_allclose(rods.length[0], [0, 0.02, 0.03, 0.05])
    np.testing.assert_allclose(rods.mass[0], [0.01, 0.025, 0.04, 0.025])
    # The second bend is about +Y, which the first bend, a quarter turn about +X, made of -Z in the root's axes.
    half = np.sqrt(0.5)
    np.testing.assert_allclose(rods.curl[0], [[0, 0, 0], [half, 0, 0], [0, 0, -half], [0, 0, 0]], atol=1e-12)


def test_support_carries_what_hangs_on_no_edge():
    """Of level edges all the weight, of the upright one, which stands in no tension, too; without support there is none."""
    rods, free = (rest_rods(CORNER[None], rest_support=support) for support in (True, False))
    np.testing.assert_allclose(rods.support[0, 1:], 9.81 * rods.mass[0, 1:, None] * [0, 1, 0], atol=1e-12)
    assert not rods.support[0, 0].any() and not free.support.any()
    np.testing.assert_array_equal(free.curl, rods.curl)


@pytest.mark.parametrize("shape", [(4, 3), (1, 2, 3), (1, 4, 2)])
def test_other_shapes_are_refused(shape):
    points = np.arange(np.prod(shape), dtype=float).reshape(shape)
    with pytest.raises(NeuralocksError, match=r"rest: shape .*; give \(strands, vertices >= 3, 3\)"):
        rest_rods(points)


def test_one_bad_strand_among_good_ones_is_found():
    points = np.tile(CORNER, (3, 1, 1))
    assert rest_rods(points).mass.shape == (3, 4) and rest_rods(points[:0]).mass.shape == (0, 4)
    points[1, 3] = points[1, 2]
    with pytest.raises(NeuralocksError, match="rest: strand 1 has an edge without length"):
        rest_rods(points)
    points[1, 3, 0] = np.nan
    with pytest.raises(NeuralocksError, match="not finite"):
        rest_rods(points)
