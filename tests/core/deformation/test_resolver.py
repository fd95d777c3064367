# SPDX-License-Identifier: Apache-2.0
"""A resolver keeps the hair of a character out of its body: which clips and grooms it serves, what it refuses, and how it works on
giants.
"""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import from_vector
from neuralocks_core.skinned_body import Body
from neuralocks_core.strands.strand_set import strand_set
from tests.core import rigs
from tests.core.deformation.ball_hair import HEAD, strands

NAMES, PARENTS = (*rigs.NAMES, f"{rigs.NAMES[rigs.HEAD]}/chin"), (*rigs.PARENTS, rigs.HEAD)
CHIN = len(rigs.NAMES)
"""A joint of the head that turns with the neck: what is on it moves relative to a head that turns."""


def test_a_resolver_serves_clips_in_which_the_same_skin_stands_still():
    """Another clip of an edited animation gets the same results as with its own resolver, bit for bit."""
    mesh, skeleton = (
        trimesh.creation.icosphere(subdivisions=2, radius=0.1),
        Skeleton(NAMES, PARENTS, with_chin(rigs.bind())),
    )
    ball, count = rigs.bind()[rigs.HEAD, :3, 3] + mesh.vertices, len(mesh.vertices)
    body = Body(
        np.concatenate([ball, ball - [0, 0.15, 0]]),
        np.concatenate([mesh.faces, mesh.faces + count]),
        np.repeat([[rigs.HEAD], [CHIN]], count, axis=0),
        np.ones((2 * count, 1)),
        {"wide": np.full((2 * count, 3), 0.01)},
    )
    character = Character(skeleton, body)
    points = strands() + rigs.bind()[rigs.HEAD, :3, 3]
    groom = Groom("Hair", points.reshape(-1, 3), np.full(60, 24))
    hair = strand_set(groom, groom.points[0], character.head_centre, character.facing)
    times = np.arange(5) / 24

    def clip(shape=0.0, **motion):
        made = rigs.moved(times, **motion)
        return Clip(times, with_chin(made.joints), np.full((5, 1), shape))

    def turn(t):
        return from_vector(np.stack([0 * t, 3 * t, 0 * t], axis=-1))

    walk, run = clip(offset=lambda t: t[:, None] * [1, 0, 0]), clip(offset=lambda t: t[:, None] * [0, 0, 3])
    resolver = Resolver(character, hair, walk)
    assert resolver.serves(run) and not resolver.serves(clip(head_turn=turn)) and not resolver.serves(clip(shape=0.5))
    results = []
    for one in (resolver, Resolver(character, hair, run)):
        moved = np.zeros((60, 24, 3), np.float32)
        moved[:, 2:] += np.float32(0.01)
        one.apply(moved, run.joints[3], run.shape[3])
        results.append(moved)
    assert np.array_equal(*results) and np.abs(results[0] - 0.01).max() > 0.02, "nothing was pushed"


def with_chin(joints):
    """Transforms (..., 6, 4, 4) of the humanoid with one that goes where its neck goes (..., 7, 4, 4)."""
    return np.concatenate([joints, joints[..., 2:3, :, :]], axis=-3)


def test_the_grooms_of_a_head_share_its_grid():
    """Locks at other places and of other lengths share it; another head has its own."""
    person, hair = rigs.person(), rigs.straight_hair()
    joint, weight = np.full((len(HEAD.vertices), 1), person.head), np.ones((len(HEAD.vertices), 1))
    clip = Clip(np.array([0.0, 1.0]), np.tile(person.skeleton.bind, (2, 1, 1, 1)))

    def grid(size, strands):
        body = Body(person.skeleton.bind[person.head, :3, 3] + size * HEAD.vertices, HEAD.faces, joint, weight)
        return Resolver(Character(person.skeleton, body), hair.subset(strands), clip)._near.head

    assert grid(1.0, [0, 1]) is grid(1.0, [5, 7]) is not grid(1.1, [5, 7])


def test_skin_that_a_blend_shape_moves_in_the_clip_does_not_stand_still():
    """A face that swells by 15 mm pushes the hair on it as far, although no joint moves."""
    person, out = rigs.person(), HEAD.vertices / np.linalg.norm(HEAD.vertices, axis=1, keepdims=True)
    on_head, origin = np.full((len(out), 1), rigs.HEAD), rigs.bind()[rigs.HEAD, :3, 3]
    body = Body(HEAD.vertices + origin, HEAD.faces, on_head, np.ones((len(out), 1)), {"swollen": 0.015 * out})
    points = strands(turn=0.5).reshape(-1, 3)
    points *= 0.103 / np.linalg.norm(points, axis=1, keepdims=True)
    hair = strand_set(Groom("Hair", points + origin, np.full(60, 24)), origin, np.zeros(3))
    times = np.arange(3) / 24
    clip = Clip(times, rigs.moved(times).joints, np.array([[0.0], [0.5], [1.0]]))
    resolver = Resolver(Character(person.skeleton, body), hair, clip)
    for row in range(3):
        moved = np.zeros((60, 24, 3), np.float32)
        resolver.apply(moved, clip.joints[row], clip.shape[row])
        skin = resolver.collider(clip.joints[row], clip.shape[row])
        assert (skin.distance(hair.rest)[0][:, 6:] < -0.002).any() == (row > 0)
        assert skin.distance(hair.rest + moved)[0][:, 6:].min() > -1e-3


def test_hair_that_rests_deep_sinks_no_deeper_where_nothing_is_known_of_the_body():
    """Five centimetres below moving skin, no vertex shows that it is inside, and those above lie as they rest."""
    person, origin, count = rigs.person(), rigs.bind()[rigs.HEAD, :3, 3], len(HEAD.vertices)
    body = Body(HEAD.vertices + origin, HEAD.faces, np.zeros((count, 1), int), np.ones((count, 1)))
    around = np.linspace(0, 0.9, 12)
    points = np.zeros((24, 3))
    points[:12, 1] = np.linspace(0.1, 0.054, 12)
    points[12:] = 0.05 * np.stack([np.sin(around), np.cos(around), 0 * around], axis=1)
    hair = strand_set(Groom("Hair", points.astype(np.float32) + origin, [24]), origin, np.zeros(3))
    clip = rigs.moved(np.arange(3) / 24, head_turn=lambda t: from_vector(np.outer(4 * t, [1, 0, 0])))
    resolver = Resolver(Character(person.skeleton, body), hair, clip)
    steps = np.diff(hair.rest[0], axis=0)
    steps[15:] = np.linalg.norm(steps[15:], axis=1)[:, None] * [0, -1, 0]
    moved = np.zeros((1, 24, 3), np.float32)
    moved[0, 1:] = hair.rest[0, 0] + np.cumsum(steps, axis=0) - hair.rest[0, 1:]
    sunk = -moved[0, -1, 1]
    resolver.apply(moved, clip.joints[0])
    assert sunk > 0.015 and -moved[0, -1, 1] < 0.2 * sunk


def test_poses_and_displacements_of_others_are_refused():
    character, hair = rigs.person(), rigs.straight_hair(5)
    count = len(HEAD.vertices)
    skin = np.full((count, 1), rigs.HEAD), np.ones((count, 1))
    body = Body(HEAD.vertices + rigs.bind()[rigs.HEAD, :3, 3], HEAD.faces, *skin)
    resolver = Resolver(Character(character.skeleton, body), hair, rigs.moved([0.0, 1.0]))
    for number, joints, name in ((4, rigs.bind(), "displacement"), (5, rigs.bind()[:2], "joints")):
        with pytest.raises(NeuralocksError, match=f"^{name}: is of shape"):
            resolver.apply(np.zeros((number, 24, 3), np.float32), joints)


def pushed(size, nods):
    """For a person `size` times as large: what 1 cm sideways is changed to (60, 24, 3) [m], and the resolver."""
    mesh, times = trimesh.creation.icosphere(subdivisions=2, radius=0.1), np.arange(3) / 24
    place = np.diag([size, size, size, 1.0])
    bind = place @ rigs.bind() @ np.linalg.inv(place)
    ball, count = bind[rigs.HEAD, :3, 3] + size * mesh.vertices, len(mesh.vertices)
    below, faces = ball - [0, 0.15 * size, 0], np.concatenate([mesh.faces, mesh.faces + count])
    joint, weight = np.repeat([[rigs.HEAD], [CHIN]], count, axis=0), np.ones((2 * count, 1))
    body, bind = Body(np.concatenate([ball, below]), faces, joint, weight), with_chin(bind)
    joints = np.tile(bind, (3, 1, 1, 1))
    joints[:, rigs.HEAD, :3, :3] = from_vector(np.outer(times, [4.0 * nods, 0, 0]))
    points = strands().reshape(-1, 3) + rigs.bind()[rigs.HEAD, :3, 3]
    hair = strand_set(Groom("Hair", points, np.full(60, 24)), rigs.bind()[rigs.HEAD, :3, 3], np.zeros(3))
    hair = replace(hair, rest=hair.rest * np.float32(size), length=hair.length * np.float32(size))
    resolver = Resolver(Character(Skeleton(NAMES, PARENTS, bind), body), hair, Clip(times, joints))
    moved = np.full((60, 24, 3), 0.01 * size, np.float32)
    resolver.apply(moved, joints[2])
    return moved, resolver


@pytest.mark.parametrize("nods", [False, True])
def test_a_giant_takes_no_more_work_than_a_person(nods):
    """As large as a character in the wrong unit; its hair is pushed like a person's."""

    def nodes(resolver):
        return np.array([resolver._near.head.values.size, resolver._near.box.count])

    (moved, person), (far, giant) = pushed(1, nods), pushed(64, nods)
    assert (len(person._near.head.moving) > 0) == nods and np.abs(moved - 0.01).max() > 0.005
    np.testing.assert_array_equal(far, 64 * moved)
    np.testing.assert_array_equal(nodes(giant), nodes(person))
    for size in (10, 100, 1000):
        assert (nodes(pushed(size, nods)[1]) < 1.5 * nodes(person)).all()


def test_a_giant_is_measured_at_its_size():
    """A giant is resolved at a person's size, but its rough distances to the skin, like the exact ones, are in metres."""
    resolver = pushed(64, False)[1]
    points = np.float32([[0, 64 * 0.103, 0], [64 * 0.098, 0, 0]])
    rough = resolver.rough_distance(points, resolver.character.skeleton.bind, np.zeros(0))
    np.testing.assert_allclose(rough, resolver.at_rest.distance(points)[0], atol=64e-3)


@pytest.mark.parametrize("size", [1, 10, 64])
def test_what_hardly_moves_on_a_person_stands_still_on_a_giant(size):
    """Half a millimetre of a person."""
    resolver = pushed(size, 0.005)[1]
    assert not len(resolver._near.head.moving)


def test_a_trunk_that_stands_still_is_not_part_of_the_heads_grid():
    """A grid around both would take seconds to build, and have no room left for the details of a face."""
    mesh, count = trimesh.creation.icosphere(subdivisions=2, radius=0.1), 162
    ball = mesh.vertices + rigs.bind()[rigs.HEAD, :3, 3]
    body = Body(
        np.concatenate([ball, ball - [0, 0.3, 0]]),
        np.concatenate([mesh.faces, mesh.faces + count]),
        np.repeat([[rigs.HEAD], [1]], count, axis=0),
        np.ones((2 * count, 1)),
    )
    origin = rigs.bind()[rigs.HEAD, :3, 3]
    hair = strand_set(Groom("Hair", strands(turn=0.5).reshape(-1, 3) + origin, np.full(60, 24)), origin, np.zeros(3))
    resolver = Resolver(Character(rigs.person().skeleton, body), hair, Clip([0.0], rigs.bind()[None]))
    outside = (resolver.at_rest.distance(hair.rest)[0] > 0).all(axis=1)
    assert resolver._near.head.cell == 0.005 and resolver._near.head.values.shape[1] < 60
    moved = np.zeros((60, 24, 3), np.float32)
    moved[:, 2:] = -0.5 * hair.rest[:, 2:] * [1, 0, 1]
    pulled = hair.rest + moved
    resolver.apply(moved, rigs.bind())
    before, after = (resolver.at_rest.distance(points)[0][outside, 2:] for points in (pulled, hair.rest + moved))
    assert outside.mean() > 0.5
    assert before.min() < -0.01 and after.min() > -1e-3
