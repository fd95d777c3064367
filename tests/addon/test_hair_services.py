# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair as the view shows it, without Blender: how thick, how turned, and out of the body."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from dcc_addon.services import bones, widths
from dcc_addon.services.live import LiveHair
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import from_vector
from neuralocks_core.runtime import StrandModel
from neuralocks_core.skinned_body import Body
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


def test_live_hair_rides_on_skin_that_blend_shapes_move():
    """As in a bake; the clip that is followed tells which shapes the shot begins with."""
    who, ball = character(), trimesh.creation.icosphere(3, 0.1)
    joints, way = np.full((len(ball.vertices), 1), who.head), np.array([0.0, 0.03, 0.01])
    shapes = {"up": np.tile(way, (len(ball.vertices), 1))}
    who = replace(who, body=Body(ball.vertices + [0, 1.68, 0], ball.faces, joints, np.ones(joints.shape), shapes))
    root = np.array([0.1, 1.68, 0])
    points = (root + np.outer(np.linspace(0, 1, 24), [0.05, -0.25, 0])).astype(np.float32)
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
