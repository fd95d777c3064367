# SPDX-License-Identifier: Apache-2.0
"""Distances around a head that stands still: those of the shape that it is, and the way out of it."""

from unittest.mock import Mock

import numpy as np
import pytest
import trimesh

import neuralocks_core.body.head_field as head_fields
from neuralocks_core import rotation
from neuralocks_core.body.head_field import ROOM, head_field
from neuralocks_core.body.near_body import NearBody
from neuralocks_core.skinned_body import Body

X = np.full(3, 0.03)
"""Corner of the space around a marble [m]."""


@pytest.fixture(scope="module")
def ball():
    return trimesh.creation.icosphere(subdivisions=4, radius=0.1)


@pytest.fixture(scope="module")
def marble():
    """Its field is built fifteen times sooner."""
    return trimesh.creation.icosphere(subdivisions=2, radius=0.02)


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
    assert not still[field.moving].all(axis=1).any()
    assert len(field.moving) == (~still[ball.faces]).any(axis=1).sum() > 0
    nodes = field.near(np.inf)
    distance, _ = field.distance(np.concatenate([nodes, nodes + [1, 0, 0], nodes - [0, 0, 1]]))
    assert np.isinf(distance[len(nodes) :]).all() and np.isfinite(distance[: len(nodes)]).any()
    top, neck = np.array([[0, 0, 0.1 + ROOM / 2]]), np.array([[0.08, 0, -0.06]])  # the grid reaches down to -0.08
    assert abs(field.distance(top)[0][0] - ROOM / 2) < 0.002 and np.isinf(field.distance(neck)[0]).all()


def test_fields_of_a_crowd_are_built_once_however_often_its_characters_take_turns(marble, monkeypatch):
    built = Mock(wraps=head_fields.HeadField)
    monkeypatch.setattr(head_fields, "HeadField", built)
    monkeypatch.setattr(head_fields, "_kept", {})
    reached = [marble.vertices[:, 2] > low for low in (-0.018, -0.014, -0.01, -0.006, -0.002, 0.002)]
    first = [head_field(marble.vertices, marble.faces, still) for still in reached]
    assert [head_field(marble.vertices, marble.faces, still) for still in reached] == first
    assert built.call_count == 6


def test_fields_that_were_not_asked_for_the_longest_make_room(marble, monkeypatch):
    monkeypatch.setattr(head_fields, "_kept", {})
    low, middle, high = (marble.vertices[:, 2] > height for height in (-0.018, -0.01, -0.002))
    kept = head_field(marble.vertices, marble.faces, low)
    dropped = head_field(marble.vertices, marble.faces, middle)
    assert head_field(marble.vertices, marble.faces, low) is kept
    monkeypatch.setattr(head_fields, "KEPT", kept.size + dropped.size)
    head_field(marble.vertices, marble.faces, high)
    assert head_field(marble.vertices, marble.faces, low) is kept
    assert head_field(marble.vertices, marble.faces, middle) is not dropped


def test_a_copy_that_stands_turned_elsewhere_shares_its_field(marble):
    still = marble.vertices[:, 2] > -0.01
    turn, place = rotation.from_vector([0, 0.6, 0]), [3, 0, 2]
    copy = (marble.vertices @ turn.T + place - place) @ turn
    assert (copy != marble.vertices).any()
    assert head_field(copy, marble.faces, still) is head_field(marble.vertices, marble.faces, still)


def test_the_skin_that_moves_is_sampled_once_for_all_grooms_and_counts_as_kept(marble, monkeypatch):
    """A neck, beside the head: as the grid of the head, it is the same for each groom."""
    monkeypatch.setattr(head_fields, "_kept", {})
    sampled = Mock(wraps=head_fields.Skin)
    monkeypatch.setattr(head_fields, "Skin", sampled)
    still = marble.vertices[:, 2] > -0.01
    count, identity = len(still), np.eye(4)
    body = Body(marble.vertices, marble.faces, np.zeros((count, 1), int), np.ones((count, 1)))
    field = head_field(marble.vertices, marble.faces, still)
    alone = field.size
    bodies = [NearBody(body, identity, still, *corners) for corners in ((-X, X), (-2 * X, 2 * X))]
    assert sampled.call_count == 1 and all(each.skin is field.skin for each in bodies)
    assert field.size == alone + sum(array.nbytes for array in vars(field.skin).values())
    assert head_field(marble.vertices, marble.faces, np.ones(count, bool)).skin is None
