# SPDX-License-Identifier: Apache-2.0
"""Roots stay on the skin that blend shapes move."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.character import Character
from neuralocks_core.deformation.root_skin import FAR, NEAR, RootSkin
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import from_vector
from neuralocks_core.skinned_body import Body
from neuralocks_core.strands.strand_set import strands_on
from tests.core import rigs

BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
SHEAR = np.array([[0.1, 0.2, 0.0], [0.0, 0.3, 0.1], [-0.2, 0.0, 0.1]])


@pytest.fixture
def character():
    """A head that does not face +Z: its first blend shape moves the skin by a linear map, the second nothing, and the third a foot far
    below.
    """
    person, count = rigs.person(from_vector(np.array([0, 1.7, 0]))), len(BALL.vertices)
    centre, foot = person.skeleton.bind[person.head, :3, 3], np.array([0, -1.5, 0])
    none, joints = np.zeros_like(BALL.vertices), np.repeat([[person.head], [0]], count, axis=0)
    shapes = {
        "sheared": np.concatenate([BALL.vertices @ SHEAR.T, none]),
        "nothing": np.concatenate([none, none]),
        "foot": np.concatenate([none, none + 0.1]),
    }
    body = Body(
        np.concatenate([BALL.vertices + centre, BALL.vertices + centre + foot]),
        np.concatenate([BALL.faces, BALL.faces + count]),
        joints,
        np.ones((2 * count, 1)),
        shapes,
    )
    return Character(person.skeleton, body)


def hair(character, places):
    """Strands of three vertices that start at `places` (n, 3) [m] from the middle of the ball and go straight out."""
    places = np.asarray(places, float)
    way = places / np.linalg.norm(places, axis=1, keepdims=True)
    points = places[:, None] + np.linspace(0, 0.1, 3)[None, :, None] * way[:, None]
    points = points + character.skeleton.bind[character.head, :3, 3]
    return strands_on(character, Groom("Hair", points.reshape(-1, 3), np.full(len(places), 3)))


def clip(character, shape):
    shape = np.asarray(shape, float)
    return Clip(np.arange(len(shape)) / 24, np.tile(character.skeleton.bind, (len(shape), 1, 1, 1)), shape)


def on_skin(count=40, mesh=BALL):
    places, _ = trimesh.sample.sample_surface(mesh, count, seed=3)
    return places


def test_strands_are_carried_as_their_place_on_the_skin(character):
    """A linear map also moves each place inside a triangle linearly."""
    places = on_skin()
    skin = RootSkin(character, [hair(character, places)], clip(character, [[0, 0, 0], [1, 1, 1]]))
    assert skin.moves
    for weight in (0.25, 1.0):
        moved = skin.moved(np.array([weight, 0.7, 0.0]))
        np.testing.assert_allclose(moved[:, 0], weight * places @ SHEAR.T @ character.facing.T, atol=1e-6)
    assert not skin.moved(np.zeros(3)).any(), "no rounding in the bind pose"


def test_roots_off_the_skin_follow_in_part(character):
    way = np.array([0.6, 0.8, 0.0])
    away = np.array([0.0, 0.9 * NEAR, (NEAR + FAR) / 2, 1.1 * FAR])
    ball = character.body.points[: len(BALL.vertices)] - character.skeleton.bind[character.head, :3, 3]
    onto = trimesh.proximity.closest_point_naive(trimesh.Trimesh(ball, BALL.faces), [0.1 * way])[0][0]
    places = onto + away[:, None] * way
    skin = RootSkin(character, [hair(character, places)], clip(character, [[0, 0, 0], [1, 0, 0]]))
    size = np.linalg.norm(skin.moved(np.array([1.0, 0, 0]))[:, 0], axis=1)
    np.testing.assert_allclose(size / size[0], [1, 1, 0.5, 0], atol=0.06)


def test_hair_is_made_for_the_body_that_it_fits(character):
    """For a body without blend shapes, or with those that the animation begins with: each groom of a head for its own."""
    steady, places = clip(character, [[1, 0, 0], [1, 0, 0]]), on_skin()
    plain, shaped = hair(character, places), hair(character, places + places @ SHEAR.T)
    assert not RootSkin(character, [shaped], steady).moves
    skin = RootSkin(character, [shaped, plain], steady)
    moved = skin.moved(steady.shape[1])[:, 0]
    assert not moved[:40].any()
    np.testing.assert_allclose(moved[40:], places @ SHEAR.T @ character.facing.T, atol=1e-6)
    begun = skin.begun(plain.joined([shaped, plain]))
    np.testing.assert_allclose(begun.rest[40:, 0], begun.rest[:40, 0], atol=1e-6)


def test_what_follows_counts_from_where_hair_lies_when_the_animation_begins(character):
    places, shapes = on_skin(6), np.array([[0.5, 0, 0], [1, 0, 0]])
    groom = hair(character, places)
    skin = RootSkin(character, [groom], clip(character, shapes))
    moved, seen = np.full((6, 24, 3), np.float32(0.01)), []
    skin.carry(moved, shapes[1], lambda moved: seen.append(moved.copy()))
    way = places @ SHEAR.T @ character.facing.T
    np.testing.assert_allclose(moved - 0.01, np.repeat(way[:, None], 24, axis=1), atol=1e-6)
    np.testing.assert_allclose(seen[0] - 0.01, 0.5 * np.repeat(way[:, None], 24, axis=1), atol=1e-6)
    np.testing.assert_allclose(skin.begun(groom).rest - groom.rest, moved - seen[0], atol=1e-6)


@pytest.mark.parametrize("shape", [[[0, 0, 0], [0, 0, 0]], [[0, 1, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 1]]])
def test_shapes_that_leave_the_skin_at_the_roots_cost_nothing(character, shape):
    groom = hair(character, on_skin(6))
    skin = RootSkin(character, [groom], clip(character, shape))
    moved = np.full((6, 24, 3), np.float32(0.01))
    skin.carry(moved, np.asarray(shape[1], float))
    assert not skin.moves and (moved == np.float32(0.01)).all() and skin.begun(groom) is groom
    bare = Character(character.skeleton)
    assert not RootSkin(bare, [groom], clip(character, shape)).moves


def test_a_groom_without_a_strand_that_moves_is_let_be(character):
    points = np.repeat(character.skeleton.bind[character.head, None, :3, 3] + [0, 0.1, 0], 3, axis=0)
    groom = strands_on(character, Groom("Dots", points, np.array([3])))
    assert not RootSkin(character, [groom], clip(character, [[0, 0, 0], [1, 0, 0]])).moves
