# SPDX-License-Identifier: Apache-2.0
"""Bodies that networks of mesh hair learn from: which they are, in which poses they are met, and what is beyond them."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.kinematics import bone_ends, pose_chains
from neuralocks_core.rig.network import feature_columns
from neuralocks_core.rig.rigging import HairRig, assemble_rig
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.rotation import from_quaternion, from_vector
from neuralocks_core.skinned_body import Body
from neuralocks_core.training.rig import deepest
from neuralocks_core.training.rig import dynamic as rig_dynamic
from neuralocks_core.training.rig.body import BodyPatch, rest_distances
from neuralocks_core.training.rig.contact import HairOnBodies
from neuralocks_core.training.rig.energy import RigEnergy
from neuralocks_core.training.rig.poses import Moments, PosePool, _random_skinning
from neuralocks_core.training.rig.report import hair_points, no_turns
from neuralocks_core.training.rig.static import train_static
from tests.core.rig.ball_head import CENTRE, RADIUS, on_a_ball


def test_bodies_in_motion_are_those_that_were_met():
    """Each body with what the network reads at that moment."""
    rig = on_a_ball()
    spec = rig_spec(dynamic=True)
    skinning = np.tile(np.eye(4), (2, len(rig.character.skeleton.names), 1, 1))
    turned = rig.character.skeleton.bind @ np.linalg.inv(rig.character.skeleton.bind)
    turned[rig.character.head, :3, :3] = from_vector(np.array([0, 0.5, 0]))
    skinning[1] = turned
    features = np.random.default_rng(0).normal(size=(2, len(feature_columns(spec)))).astype(np.float32)
    hair = HairOnBodies(rig, RigMaterial(), 16, np.random.default_rng(0), spec, Moments(features, skinning))
    seen = []

    def noted(read):
        seen.append(read.numpy())
        return still(rig, read)

    hair.parts(noted, 64)
    rows = (seen[0][:, None] == features).all(-1)
    assert rows.any(1).all() and rows.any(0).all()
    neck = hair.pool.relative[:, 0]
    expected = np.stack([np.eye(3), turned[rig.character.head, :3, :3].T])
    np.testing.assert_allclose(neck, expected[hair.pool.moment], atol=1e-12)


def cap_over_a_chest() -> HairRig:
    """Points all round the head that no joint moves, and a chest which they touch in some poses."""
    rig = on_a_ball()
    points = np.random.default_rng(0).normal(0, 1, (40, 3))
    points = CENTRE + 1.5 * RADIUS * points / np.linalg.norm(points, axis=1, keepdims=True)
    return replace(with_chest(rig), points=points, weights=np.eye(1, len(rig.chains) + 1).repeat(len(points), 0))


def still(rig: HairRig, features) -> torch.Tensor:
    """A network's answer: no turns."""
    return torch.as_tensor(no_turns(rig), dtype=torch.float32).expand(len(features), -1, -1)


def test_hair_comes_back_to_where_it_lay_deepest(monkeypatch):
    """For half of a batch, where the same answer costs more than in new poses; replaced poses are forgotten."""
    monkeypatch.setattr("neuralocks_core.training.rig.contact.HARD", 16)
    rig = cap_over_a_chest()
    held = HairOnBodies(rig, RigMaterial(), 64, np.random.default_rng(0), rig_spec())
    costs = np.array([held.parts(partial(still, rig), 8)[1].numpy() for _ in range(200)])[20:]
    assert costs[:, :4].mean() > 1.3 * costs[:, 4:].mean() > 0


@pytest.mark.parametrize("moving", [False, True], ids=["held", "in motion"])
def test_the_deepest_of_many_poses_are_learned_from(monkeypatch, moving):
    """Of all that are searched, those in which a vertex is deepest, again after some are replaced; in motion with what the network
    reads at that moment.
    """
    monkeypatch.setattr(deepest, "KEPT", 8)
    monkeypatch.setattr(deepest, "EVERY", 2)
    monkeypatch.setattr(deepest, "RENEWED", 32)
    rig, rng = cap_over_a_chest(), np.random.default_rng(0)
    read = rng.normal(size=(40, len(feature_columns(rig_spec())))).astype(np.float32)
    moments = Moments(read, _random_skinning(rig.character, len(read), rng)) if moving else None
    poses = deepest.DeepestPoses(rig, RigMaterial(), rng, rig_spec(), moments, searched=64)
    energy, pool, rows = RigEnergy(rig, RigMaterial()), poses._pool, np.arange(64)
    before, asked = None, []

    def answer(features):
        asked.append(features.numpy())
        return still(rig, features)

    for _ in range(3):
        costs = [poses.contact(answer, 8).sort().values for _ in range(2)]
        depth = energy.depths(pool, rows, still(rig, rows))
        assert 0 < (depth > 0).sum() < 64 and (before is None or 0 < (before != depth).sum() <= 32)
        worst = np.argsort(-depth)[:8]
        wanted = energy.parts(pool, worst, still(rig, worst), np.zeros((8, 3)))[1].sort().values
        assert torch.equal(costs[0], wanted) and torch.equal(costs[1], wanted)
        if moving:
            assert set(map(bytes, asked[-1])) == set(map(bytes, read[pool.moment[worst]]))
        before = depth


def test_fewer_poses_of_large_bodies_are_searched(monkeypatch):
    """So that memory is bounded, however many vertices the hair can reach."""
    rig = cap_over_a_chest()
    monkeypatch.setattr(deepest, "MEMORY", 300 * PosePool.size(rig))
    poses = deepest.DeepestPoses(rig, RigMaterial(), np.random.default_rng(0), rig_spec())
    held = poses._pool._read.nbytes + poses._pool._index.nbytes
    assert poses._pool.count == 300 and held == pytest.approx(deepest.MEMORY, rel=0.1)
    assert len(poses.contact(partial(still, rig), 8)) == 8


def with_chest(rig: HairRig) -> HairRig:
    """The same rig with another ball, for a chest."""
    who = rig.character
    names = [name.rsplit("/", 1)[-1] for name in who.skeleton.names]
    body = who.body
    chest = body.points - body.points.mean(axis=0) + (0, 1.3, 0)
    joints = np.concatenate([body.joint_indices, np.full_like(body.joint_indices, names.index("chest"))])
    triangles = np.concatenate([body.triangles, body.triangles + len(chest)])
    both = Body(np.concatenate([body.points, chest]), triangles, joints, np.ones_like(joints, float))
    return replace(rig, character=replace(who, body=both))


def test_twist_of_a_lock_is_seen_and_learned_from():
    """Locks turned about their own bones keep the bones' ends; their mesh, and what training compares, show the twist."""
    rig = on_a_ball()
    turns = np.broadcast_to(no_turns(rig), (2, len(rig.chains), 4)).copy()
    angle, joint = 1.0, rig.chains.bone_joint[-1]
    axis = rig.chains.bones[-1] / np.linalg.norm(rig.chains.bones[-1])
    turns[1, joint] = [np.cos(angle / 2), *(np.sin(angle / 2) * axis)]
    ends = bone_ends(rig.chains, *pose_chains(rig.chains, from_quaternion(turns)))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-12)
    still, twisted = hair_points(rig, turns)
    assert np.linalg.norm(twisted - still, axis=1).max() > 0.01
    marks = rig_dynamic._marks(RigEnergy(rig, RigMaterial(), dtype=torch.float64), torch.as_tensor(turns))
    # Of a turn R by an angle a, |R - 1|^2 = 4 (1 - cos a).
    expected = rig_dynamic._BESIDE**2 * 4 * (1 - np.cos(angle))
    assert (marks[1] - marks[0]).square().sum().item() == pytest.approx(expected, rel=1e-9)


def assembled(rig: HairRig, body: Body, joint: int) -> HairRig:
    """The rig of such a hair and a body on one joint, as files hold them: two meshes of one character."""
    who = rig.character
    joints = np.full((len(body.points), 1), joint)
    ribbon = rig.points + who.skeleton.bind[who.head, :3, 3]
    on = rig.chains.joints[rig.weights[:, 1:].argmax(axis=1)][:, None]
    meshes = [
        Body(body.points, body.triangles, joints, np.ones_like(joints, float)),
        Body(ribbon, np.arange(len(ribbon)).reshape(-1, 3), on, np.ones((len(ribbon), 1))),
    ]
    both = Body(
        np.concatenate([body.points, ribbon]),
        np.concatenate([body.triangles, meshes[1].triangles + len(body.points)]),
        np.concatenate([joints, on]),
        np.ones((len(body.points) + len(ribbon), 1)),
    )
    return assemble_rig(replace(who, body=both), meshes)


@pytest.mark.parametrize("away", [0.0, 1.5])
def test_a_body_out_of_the_hairs_reach_is_none(away):
    """With only shoes on the skeleton, nothing is near, and training continues without a body."""
    rig = on_a_ball()
    who, body = rig.character, rig.character.body
    body = replace(body, points=body.points - (0, away, 0))
    rig = assembled(rig, body, who.head if not away else who.skeleton.names.index("hips"))
    assert (rig.character.body is None) == (away > 0)
    assert train_static(rig, steps=2, batch=4, report_poses=0).training["steps"] == 2


def test_hair_does_not_sink_into_a_head_without_a_scalp():
    """What is below hair is often left out of a head; the surface over the hole is part of the body."""
    rig = on_a_ball()
    body, head = rig.character.body, rig.character.head
    high = body.points[body.triangles][:, :, 1].max(axis=1) - body.points[:, 1].mean() > 0.85 * RADIUS
    rig = assembled(rig, replace(body, triangles=body.triangles[~high]), head)
    below = np.array([CENTRE + (0, 0.8 * RADIUS, 0)])
    assert -0.02 < rest_distances(rig, below)[0] < 0


def test_other_bodies_vary_below_the_head():
    """The hair was fitted to the head: what a blend shape does there, also to a face on joints of its own, and any motion of both
    does not vary. Those of the face alone are not drawn.
    """
    rig = with_chest(on_a_ball())
    who, body = rig.character, rig.character.body
    on_head = body.joint_indices[:, 0] == who.head
    face = on_head & (body.points[:, 2] > 0.05)
    joints = np.where(face, len(who.skeleton.names) - 1, body.joint_indices[:, 0])[:, None]
    shapes = {
        "wide": np.where(on_head[:, None], [0.0, 0.01, 0.0], [0.0, 0.01, 0.05]),
        "smile": np.where(face[:, None], [0.0, 0.0, 0.02], 0.0),
    }
    shapes["wide"][face, 0] = 0.01 * np.sign(body.points[face, 0])
    rig = replace(rig, character=replace(who, body=replace(body, joint_indices=joints, shapes=shapes)))
    patch = BodyPatch.of(rig, 300)
    still = np.tile(np.eye(4), (len(who.skeleton.names), 1, 1))
    moved = patch.body.posed(still, np.array([1.0])) - patch.body.points
    below = ~who.of_head[patch.body.joint_indices[:, 0]]
    assert below.any() and not below.all() and list(patch.body.shapes) == list(patch.read.shapes) == ["wide"]
    np.testing.assert_allclose(moved[~below], 0, atol=1e-12)
    np.testing.assert_allclose(moved[below], np.tile([0, 0, 0.05], (below.sum(), 1)), atol=1e-12)
