# SPDX-License-Identifier: Apache-2.0
"""Distances around a head that stands still: those of the shape that it is, and the way out of it."""

from unittest.mock import Mock

import numpy as np
import pytest
import trimesh

import neuralocks_core.body.head_field as head_fields
from neuralocks_core import rotation
from neuralocks_core.body.head_field import ROOM, head_field


@pytest.fixture(scope="module")
def ball():
    return trimesh.creation.icosphere(subdivisions=4, radius=0.1)


def test_a_ball_is_as_far_and_in_the_direction_that_it_is(ball):
    field = head_field(ball.vertices, ball.faces, np.ones(len(ball.vertices), bool))
    out = np.random.default_rng(0).normal(size=(2000, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    away = np.random.default_rng(1).uniform(-0.02, 0.008, 2000)
    points = ((0.1 + away)[:, None] * out).astype(np.float32)
    distance, direction = field.distance(points)
    assert distance.dtype == direction.dtype == np.float32
    assert np.abs(distance - away).max() < 2.5e-4 and (direction * out).sum(axis=1).min() > 0.999
    assert np.abs(field.rough(points) - away).max() < 0.87 * field.cell + 5e-4


def test_nothing_is_known_beyond_the_grid_and_where_something_moves(ball):
    still = ball.vertices[:, 2] > -0.05
    field = head_field(ball.vertices, ball.faces, still)
    assert (len(field.moving) > 0) and not still[field.moving].all(axis=1).any()
    nodes = field.near(np.inf)
    distance, _ = field.distance(np.concatenate([nodes, nodes + [1, 0, 0], nodes - [0, 0, 1]]))
    assert np.isinf(distance[len(nodes) :]).all() and np.isfinite(distance[: len(nodes)]).any()
    top, neck = np.array([[0, 0, 0.1 + ROOM / 2]]), np.array([[0.08, 0, -0.06]])  # the grid reaches down to -0.08
    assert abs(field.distance(top)[0][0] - ROOM / 2) < 0.002 and np.isinf(field.distance(neck)[0]).all()


def test_fields_of_a_crowd_are_built_once_however_often_its_characters_take_turns(ball, monkeypatch):
    built = Mock(wraps=head_fields.HeadField)
    monkeypatch.setattr(head_fields, "HeadField", built)
    monkeypatch.setattr(head_fields, "_kept", {})
    reached = [ball.vertices[:, 2] > low for low in (-0.09, -0.07, -0.05, -0.03, -0.01, 0.01)]
    first = [head_field(ball.vertices, ball.faces, still) for still in reached]
    assert [head_field(ball.vertices, ball.faces, still) for still in reached] == first
    assert built.call_count == 6


def test_fields_that_were_not_asked_for_the_longest_make_room(ball, monkeypatch):
    monkeypatch.setattr(head_fields, "_kept", {})
    low, middle, high = (ball.vertices[:, 2] > height for height in (-0.09, -0.05, -0.01))
    kept = head_field(ball.vertices, ball.faces, low)
    dropped = head_field(ball.vertices, ball.faces, middle)
    assert head_field(ball.vertices, ball.faces, low) is kept
    monkeypatch.setattr(head_fields, "KEPT", kept.size + dropped.size)
    head_field(ball.vertices, ball.faces, high)
    assert head_field(ball.vertices, ball.faces, low) is kept
    assert head_field(ball.vertices, ball.faces, middle) is not dropped


def test_a_copy_that_stands_turned_elsewhere_shares_its_field(ball):
    still = ball.vertices[:, 2] > -0.05
    turn, place = rotation.from_vector([0, 0.6, 0]), [3, 0, 2]
    copy = (ball.vertices @ turn.T + place - place) @ turn
    assert (copy != ball.vertices).any()
    assert head_field(copy, ball.faces, still) is head_field(ball.vertices, ball.faces, still)
