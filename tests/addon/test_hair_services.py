# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair as the view shows it, without Blender: how thick, how turned, and out of the body."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from dcc_addon.services.hair import bones, widths
from dcc_addon.services.hair.history import SampledBoundary
from dcc_addon.services.hair.live import LiveHair
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import from_vector
from neuralocks_core.skinned_body import Body
from neuralocks_core.wind import Wind
from tests.core.rig.builders import character


@pytest.mark.parametrize(("shape", "power"), [(0.0, 1.0), (0.5, 2.0), (-0.5, 0.5)])
def test_strands_thin_out_as_cycles_draws_them(shape, power):
    """Blender: (1 - t) ^ (1 / (1 - shape)), below 0 ^ (1 + shape), from the tip's radius to the root's."""
    t = np.linspace(0, 1, 5)
    hair = Groom("hair", np.outer(t, [0, 0, 0.2]), np.array([5]), None)
    assert widths.radii(hair, 3.0, 1.0, shape, pointed=False) == pytest.approx(1 + 2 * (1 - t) ** power, rel=1e-6)
    assert widths.radii(hair, 3.0, 1.0, shape, pointed=True)[-1] == 0


def test_a_bone_scaled_to_nothing_has_no_turn_of_its_own():
    own = np.stack([np.zeros((3, 3)), 2 * from_vector([0, 0, 0.5])])[None]
    turns = bones.own_turns(own, SimpleNamespace(row=lambda frame: 0), np.array([0, 1]), np.array([1]))
    assert turns[0] == pytest.approx(np.array([[1, 0, 0, 0], [np.cos(0.25), 0, 0, np.sin(0.25)]]), abs=1e-6)


def test_live_hair_leaves_an_arm_that_the_network_does_not_read():
    """At one time, with one answer of the network: a forearm beside the hair or in it."""
    who, ball = character(), trimesh.creation.icosphere(3, 0.1)
    leaves = [name.rsplit("/", 1)[-1] for name in who.skeleton.names]
    arm = leaves.index("left_lower_arm")
    head, hand = ball.vertices + [0, 1.68, 0], ball.vertices + who.skeleton.bind[arm, :3, 3]
    joints = np.repeat([who.head, arm], len(ball.vertices))[:, None]
    faces = np.concatenate([ball.faces, ball.faces + len(ball.vertices)])
    who = replace(who, body=Body(np.concatenate([head, hand]), faces, joints, np.ones(joints.shape)))
    root = np.array([0.102, 1.68, 0])
    hair = Groom(
        "hair", (root + np.outer(np.linspace(0, 1, 24), [0.05, -0.25, 0])).astype(np.float32), np.array([24]), None
    )
    poses = np.tile(who.skeleton.bind, (2, 1, 1, 1))
    poses[1, arm, :3, 3] = root + [0.1, -0.2, 0]
    live = LiveHair(hair, who, StrandModel.load())
    live.follow(Clip([0.0, 1.0], poses))
    for resolve in (False, True):
        beside, within = (live.points(0.0, pose, np.eye(4), resolve=resolve).copy() for pose in poses)
        assert (np.abs(within - beside).max() > 0.01) == resolve


@pytest.mark.parametrize("near", [9.0, 0.04])
def test_live_hair_rides_on_skin_that_blend_shapes_move(near):
    """As in a bake; the clip that is followed tells which shapes the shot begins with. A small patch of skin, which does not make the
    body another one to the network, takes its hair along, too.
    """
    who, ball = character(), trimesh.creation.icosphere(4, 0.1)
    joints, way = np.full((len(ball.vertices), 1), who.head), np.array([0.0, 0.03, 0.01])
    ahead = np.array([0.06, 0.05, 0.062])
    shapes = {"up": way * (np.linalg.norm(ball.vertices - ahead, axis=1) < near)[:, None]}
    who = replace(who, body=Body(ball.vertices + [0, 1.68, 0], ball.faces, joints, np.ones(joints.shape), shapes))
    points = (np.array([0, 1.68, 0]) + ahead + np.outer(np.linspace(0, 1, 24), [0.05, 0.25, 0.1])).astype(np.float32)
    poses = np.tile(who.skeleton.bind, (2, 1, 1, 1))
    live = LiveHair(Groom("hair", points, np.array([24]), None), who, StrandModel.load())
    for resolve in (False, True):
        live.follow(Clip([0.0, 1.0], poses, np.array([[0.0], [1.0]])))
        begun, half, end = (live.points(t, poses[0], np.eye(4), resolve=resolve)[0].copy() for t in (0.0, 0.5, 1.0))
        assert [half - begun, end - begun] == [pytest.approx(way / 2, abs=1e-6), pytest.approx(way, abs=1e-6)]
        live.follow(Clip([0.0, 1.0], poses, np.zeros((2, 1))))
        assert live.points(1.0, poses[0], np.eye(4), resolve=resolve)[0] == pytest.approx(begun, abs=1e-6)


def test_live_hair_that_follows_another_clip_is_as_if_it_had_followed_no_other():
    """The body is wider from the first frame on, and the network answers its held pose differently."""
    who, ball = character(), trimesh.creation.icosphere(3, 0.1)
    joints = np.full((len(ball.vertices), 1), who.head)
    wider = {"wide": ball.vertices * [0.15, 0, 0.15]}
    who = replace(who, body=Body(ball.vertices + [0, 1.68, 0], ball.faces, joints, np.ones(joints.shape), wider))
    points = np.array([0.1, 1.68, 0]) + np.outer(np.linspace(0, 1, 24), [0.05, -0.25, 0])
    hair, model = Groom("hair", points.astype(np.float32), np.array([24]), None), StrandModel.load()
    poses, times = np.tile(who.skeleton.bind, (2, 1, 1, 1)), [0.0, 1.0]
    plain, wide = (Clip(times, poses, np.full((2, 1), weight)) for weight in (0.0, 1.0))
    shown = []
    for clips in ((plain, wide), (wide,)):
        live = LiveHair(hair, who, model)
        for clip in clips:
            live.follow(clip)
            found = live.points(0.5, poses[0], np.eye(4)).copy()
        shown.append(found)
    np.testing.assert_array_equal(*shown)


def test_live_hair_that_follows_another_clip_is_pushed_out_of_skin_that_stood_still_before():
    """A bump that grows below the strand."""
    who, ball = character(), trimesh.creation.icosphere(3, 0.1)
    joints, bump = np.full((len(ball.vertices), 1), who.head), (ball.vertices[:, :1] > 0.09) * [0.02, 0, 0]
    who = replace(
        who, body=Body(ball.vertices + [0, 1.68, 0], ball.faces, joints, np.ones(joints.shape), {"bump": bump})
    )
    points = np.array([0.07, 1.755, 0]) + np.outer(np.linspace(0, 1, 24), [0.06, -0.15, 0])
    hair, model = Groom("hair", points.astype(np.float32), np.array([24]), None), StrandModel.load()
    poses, times, shown = np.tile(who.skeleton.bind, (2, 1, 1, 1)), [0.0, 1.0], []
    still, growing = (Clip(times, poses, np.array([[0.0], [end]])) for end in (0.0, 1.0))
    for clips in ((still, growing), (growing,)):
        live = LiveHair(hair, who, model)
        for each in clips:
            live.follow(each)
            plain, pushed = (live.points(1.0, poses[0], np.eye(4), resolve=on).copy() for on in (False, True))
        shown.append(pushed)
    np.testing.assert_array_equal(*shown)
    assert np.abs(pushed - plain).max() > 0.005


def test_a_frame_that_fails_is_not_taken_for_the_one_before(monkeypatch):
    """The same points are given again while nothing changes; not those that were written half."""
    who = character()
    points = np.array([0.1, 1.68, 0]) + np.outer(np.linspace(0, 1, 24), [0.05, -0.25, 0])
    live = LiveHair(Groom("hair", points.astype(np.float32), np.array([24]), None), who, StrandModel.load())
    poses = np.tile(who.skeleton.bind, (2, 1, 1, 1))
    poses[1, :, 0, 3] += 0.1
    live.follow(Clip([0.0, 1.0], poses))
    first = live.points(0.0, poses[0], np.eye(4)).copy()

    def carry(_displacement, out, *_):
        out[:12] = 0
        raise NeuralocksError("stop")

    with monkeypatch.context() as patched, pytest.raises(NeuralocksError, match="stop"):
        patched.setattr(live._carrier, "carry", carry)
        live.points(1.0, poses[1], np.eye(4))
    np.testing.assert_array_equal(live.points(0.0, poses[0], np.eye(4)), first)


def test_what_the_network_reads_is_that_of_the_pose_and_the_look():
    """In blocks or one by one: at samples and between, of another pose than the sampled one, with other sliders, in a wind."""
    who, rng = character(), np.random.default_rng(0)
    poses = np.tile(who.skeleton.bind, (20, 1, 1, 1))
    poses[:, who.head, :3, :3] = from_vector(np.cumsum(rng.normal(0, 0.1, (20, 3)), axis=0))
    sampler = StrandModel.load().sampler(who, Clip(np.arange(20) / 24, poses))
    kept, calm = SampledBoundary(sampler), (0.0,) * 4
    for time, pose in ((9 / 24, 9), (9 / 24, 3), (9.5 / 24, 9), (10 / 24, 10), (19 / 24, 19), (2.0, 19)):
        for look in (
            (calm, 1.0, None),
            (calm, 0.5, None),
            ((0.3, 0.0, 0.2, 0.0), 1.0, None),
            (calm, 1.0, Wind((1.0, 0, 2.0), 0.5)),
        ):
            *own, wind = look
            wanted = sampler.vectors([time], *own, poses[[pose]], wind)[0]
            np.testing.assert_array_equal(kept.vector(time, np.array(own[0]), own[1], poses[pose], wind), wanted)


@pytest.mark.parametrize("size", [1.0, 8.0])
def test_hair_far_from_the_skin_is_beside_its_character_by_the_size_of_that(size):
    """A giant's wig floats further off than a person's hat."""
    who, ball = character(), trimesh.creation.icosphere(3, 0.08 * size)
    bind = who.skeleton.bind.copy()
    bind[:, :3, 3] *= size
    joints = np.full((len(ball.vertices), 1), who.head)
    body = Body(ball.vertices + [0, 1.6 * size, 0], ball.faces, joints, np.ones(joints.shape))
    who = Character(replace(who.skeleton, bind=bind), body)
    assert who.times_human == size
    strand = np.array([0.1, 1.6, 0]) + np.outer(np.linspace(0, 1, 24), [0.05, -0.25, 0])
    for aside, told in ((0.2, False), (0.4, True)):
        hair = Groom("hair", (size * (strand + [aside, 0, 0])).astype(np.float32), np.array([24]), None)
        assert (LiveHair(hair, who, StrandModel.load()).off_skin > 0) == told


def test_hair_on_a_head_without_skin_is_not_beside_its_character():
    """A body may end at the neck."""
    who, ball = character(), trimesh.creation.icosphere(2, 0.1)
    joints = np.zeros((len(ball.vertices), 1), int)
    who = replace(who, body=Body(ball.vertices + [0, 1.0, 0], ball.faces, joints, np.ones(joints.shape)))
    strand = np.array([0.1, 1.68, 0]) + np.outer(np.linspace(0, 1, 24), [0.05, -0.25, 0])
    for aside, told in ((0.0, False), (1.0, True)):
        hair = Groom("hair", (strand + [aside, 0, 0]).astype(np.float32), np.array([24]), None)
        assert (LiveHair(hair, who, StrandModel.load()).off_skin > 0.3) == told
    assert LiveHair(hair, replace(who, body=None), StrandModel.load()).off_skin == 0
