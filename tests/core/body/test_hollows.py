# SPDX-License-Identifier: Apache-2.0
"""A hollow that opens by a slit is inside; an open dent and the outer skin are as they are."""

import numpy as np
import pytest
from scipy import ndimage

from neuralocks_core.body.hollows import BALL, CREASE, NEIGHBOURS, filled

CELL = 0.005
PLACES = CELL * np.stack(np.meshgrid(*[np.arange(-30, 31)] * 3, indexing="ij"), axis=-1)


def ball(radius, middle=(0.0, 0.0, 0.0)):
    return np.linalg.norm(PLACES - middle, axis=-1) - radius


def tube(radius):
    """A tunnel along z > 0."""
    away = np.linalg.norm(PLACES[..., :2], axis=-1) - radius
    return np.maximum(away, -PLACES[..., 2])


@pytest.mark.parametrize("slit", [0.0, 0.002])
def test_a_hollow_is_as_deep_as_the_skin_around_it(slit):
    mouth = ball(0.03, (0, 0, 0.04))
    air = mouth if not slit else np.minimum(mouth, tube(slit))
    head = np.maximum(ball(0.1), -air)
    found = filled(head, CELL)
    assert (head > 0.02)[mouth < -0.02].all()
    inside = ball(0.1) < -0.005
    off = np.abs(found - ball(0.1))[inside & (mouth < 0.01)]
    assert found[mouth < 0].max() < -0.02 and off.max() < 0.006
    np.testing.assert_array_equal(found[ball(0.1) > 0.004], head[ball(0.1) > 0.004])


def test_an_open_dent_and_a_solid_head_stay_as_they_are():
    for head in (ball(0.1), np.maximum(ball(0.1), -ball(0.03, (0, 0, 0.1)))):
        found = filled(head, CELL)
        assert (found == head).mean() > 0.98 and np.abs(found - head).max() < 0.003


def test_a_grid_without_any_outside_stays():
    deep = np.full((4, 4, 4), -0.05)
    np.testing.assert_array_equal(filled(deep, CELL), deep)


def test_every_node_is_as_deep_as_the_balls_that_touch_the_skin_leave_it():
    """Also those that are left out of the search because a ball nearby shows that nothing becomes of it."""
    skin = ball(0.1)
    head = np.maximum(skin, -ball(0.03, (0, 0, 0.04)))
    outside = skin >= BALL
    rim = np.argwhere(outside & ~ndimage.binary_erosion(outside, np.ones((3, 3, 3)), border_value=1))
    asked = np.random.default_rng(0).choice(np.argwhere(~outside), 200, replace=False)
    away = CELL * np.linalg.norm(asked[:, None] - rim, axis=-1)
    near = np.argsort(away, axis=1)[:, :NEIGHBOURS]
    depth = (np.take_along_axis(away, near, axis=1) - head[tuple(rim.T)][near]).min(axis=1) - CREASE
    found, before = filled(head, CELL)[tuple(asked.T)], head[tuple(asked.T)]
    assert 0 < (found < before).mean() < 0.5
    np.testing.assert_allclose(found, np.minimum(before, -depth), atol=2e-4)  # of nodes equally far, some are taken
