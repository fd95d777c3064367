# SPDX-License-Identifier: Apache-2.0
"""A groom refuses what no hair can be, and says which groom and why."""

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom

POINTS = np.arange(15, dtype=float).reshape(5, 3) * 0.01


def test_types_and_defaults():
    groom = Groom("/hair", POINTS, [3, 2])
    assert (groom.points.dtype, groom.counts.dtype, groom.widths.dtype) == (np.float32, np.int32, np.float32)
    assert groom.widths.shape == (1,)
    np.testing.assert_array_equal(groom.starts, [0, 3])
    np.testing.assert_array_equal(groom.strand_of_point, [0, 0, 0, 1, 1])
    with pytest.raises(ValueError, match="read-only"):
        groom.points[0] = 0


def test_a_groom_stays_as_it_is_when_its_arrays_are_used_again():
    points, counts, guides = POINTS.astype(np.float32), np.array([3, 2], np.int32), np.zeros(2, bool)
    widths = np.ones(5, np.float32)
    behind = points.view()
    behind.flags.writeable = False
    grooms = [Groom("/hair", each, counts, widths, guides=guides, group=counts) for each in (points, behind)]
    points[:], counts[:], guides[:], widths[:] = 9, 1, True, 5
    for groom in grooms:
        np.testing.assert_array_equal(groom.points, POINTS.astype(np.float32))
        np.testing.assert_array_equal([groom.counts, groom.group], [[3, 2]] * 2)
        assert not groom.guides.any() and (groom.widths == 1).all()


def test_what_nobody_can_write_to_is_not_copied():
    groom = Groom("/hair", POINTS, [3, 2])
    part = Groom("/part", groom.points[3:], groom.counts[1:])
    assert np.shares_memory(part.points, groom.points) and np.shares_memory(part.counts, groom.counts)


def test_subset_takes_everything_along():
    groom = Groom(
        "/hair",
        POINTS,
        [2, 0, 3],
        widths=np.arange(5),
        root_uv=np.arange(6).reshape(3, 2),
        guides=[True, False, False],
        group=[7, 8, 9],
    )
    part = groom.subset([2, 0])
    np.testing.assert_array_equal(part.points, np.asarray(POINTS, np.float32)[[2, 3, 4, 0, 1]])
    np.testing.assert_array_equal(part.counts, [3, 2])
    np.testing.assert_array_equal(part.widths, [2, 3, 4, 0, 1])
    np.testing.assert_array_equal(part.root_uv, [[4, 5], [0, 1]])
    np.testing.assert_array_equal(part.guides, [False, True])
    np.testing.assert_array_equal(part.group, [9, 7])
    each = Groom("/hair", POINTS, [2, 0, 3], widths=[0.1, 0.2, 0.3]).subset([2, 0])
    np.testing.assert_array_equal(each.widths, np.float32([0.3, 0.1]))


@pytest.mark.parametrize(
    ("changes", "fact"),
    [
        (
            {"points": np.where(np.arange(15).reshape(5, 3) == 10, np.nan, 0.0)},
            r"1 of 5 points are not finite.*number 3",
        ),
        ({"points": np.full((5, 3), np.inf)}, "not finite"),
        ({"points": POINTS * 1e9}, "farther than 10000 m"),
        ({"widths": np.full(POINTS.shape[0], 2e4)}, "widths exceed 10000 m"),
        ({"points": POINTS[:, :2]}, r"shape \(5, 2\)"),
        ({"points": [["a"]]}, "plain array"),
        ({"counts": [3, 3]}, "sum to 6 but there are 5"),
        ({"counts": []}, "no strands"),
        ({"counts": [6, -1]}, "strand 1 has a negative"),
        ({"counts": [2.5, 2.5]}, "whole numbers"),
        ({"counts": [2**40, 5]}, "32 bits"),
        ({"counts": [[3, 2]]}, "counts have shape"),
        ({"points": np.zeros((0, 3)), "counts": [0, 0]}, "no points"),
        ({"widths": [1, 2, 3]}, "widths have shape"),
        ({"widths": [1, -1]}, "widths are negative"),
        ({"widths": [np.nan]}, "widths are not finite"),
        ({"root_uv": np.zeros((5, 2))}, "root_uv has shape"),
        ({"root_uv": np.full((2, 2), np.inf)}, "root_uv are not finite"),
        ({"group": [1]}, "group has shape"),
        ({"points": POINTS.astype(str)}, "points is not a plain array"),
        ({"points": POINTS + 1j}, "points is not a plain array"),
        ({"widths": "0.1"}, "widths is not a plain array"),
        ({"guides": ["False", "no"]}, "guides are neither true nor false"),
        ({"guides": [np.nan, 1]}, "guides are neither true nor false"),
    ],
)
def test_bad_input_names_the_groom(changes, fact):
    with pytest.raises(NeuralocksError, match=f"^/hair: .*{fact}.*; "):
        Groom(**{"name": "/hair", "points": POINTS, "counts": [3, 2], **changes})


@pytest.mark.parametrize("strands", [[2], [0.0], [True], [], ["0"], [[0]], 0, [[0], [1, 0]]])
def test_a_subset_of_strands_that_it_lacks_names_the_groom(strands):
    groom = Groom("/hair", POINTS, [3, 2], guides=[0, 1])
    np.testing.assert_array_equal(groom.subset([-1]).guides, [True])
    with pytest.raises(
        NeuralocksError, match=r"^/hair: a subset is not of its strands; give indices below 2, or a mask \(2,\)"
    ):
        groom.subset(strands)
