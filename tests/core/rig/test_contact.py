# SPDX-License-Identifier: Apache-2.0
"""What mesh hair does at the body: in the simulation of its chains, and in what networks learn from."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import trimesh

torch = pytest.importorskip("torch")

from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.body.collider import Collider
from neuralocks_core.reference.chain_contact import BodyMesh, Contacts
from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.rig import find_chains, rig_spec
from neuralocks_core.rig.kinematics import bone_ends, pose_chains, skin
from neuralocks_core.rig.network import feature_columns
from neuralocks_core.rig.rigging import HairRig, assemble_rig
from neuralocks_core.rig.rods import RigMaterial, RodTree
from neuralocks_core.rig.skinned_mesh import SkinnedMesh
from neuralocks_core.rotation import from_quaternion, from_vector
from neuralocks_core.skinned_body import Body
from neuralocks_core.training.rig import deepest
from neuralocks_core.training.rig import dynamic as rig_dynamic
from neuralocks_core.training.rig.body import BodyPatch, rest_distances
from neuralocks_core.training.rig.contact import HairOnBodies
from neuralocks_core.training.rig.energy import RigEnergy
from neuralocks_core.training.rig.motion import simulate_motions
from neuralocks_core.training.rig.poses import Moments, PosePool, _random_skinning
from neuralocks_core.training.rig.report import hair_points, no_turns
from neuralocks_core.training.rig.static import train_static
from tests.core.rig.builders import character, tail

RADIUS = 0.12
CENTRE = np.array([0, 0.05, 0.02])
"""Centre of the head's ball, from the head joint."""


def on_a_ball() -> HairRig:
    """A tail of ribbons, 6 cm wide, behind a ball for a head."""
    who = character(tail("hair", 5, at=(0, 1.65, -0.12), step=(0, -0.06, -0.002)))
    ball = trimesh.creation.icosphere(4, RADIUS)
    points = ball.vertices + CENTRE + who.skeleton.bind[who.head, :3, 3]
    joints = np.full((len(points), 1), who.head)
    who = replace(who, body=Body(points, ball.faces, joints, np.ones((len(points), 1))))
    chains = find_chains(who)
    along = chains.origins[:, None] + chains.bones[:, None] * np.linspace(0.1, 0.9, 5)[:, None]
    points = np.concatenate([along + (side, 0, 0) for side in (-0.03, 0.0, 0.03)], axis=1)
    weights = np.repeat(np.eye(len(chains), len(chains) + 1, 1), points.shape[1], axis=0)
    return HairRig(who, chains, points.reshape(-1, 3), weights, np.zeros((0, 3), int))


def test_ribbons_that_fall_over_the_head_lie_on_it():
    """Edges as well as middles; without a body they fall through."""
    rig = on_a_ball()
    patch = BodyPatch.of(rig, 500)
    read = rig.character.canonical(patch.read.points).astype(np.float32)
    heads = np.tile(np.eye(4), (1, 60, 1, 1))
    bow = np.stack([from_vector(np.array([angle, 0, 0])) for angle in np.linspace(0, np.radians(110), 30)])
    heads[0, :, :3, :3] = np.concatenate([bow, bow[-1:].repeat(30, axis=0)])
    balls = BodyMesh(patch.samples, read[None, None].repeat(60, 1), read)
    material = RigMaterial(bend=1e-3, rest_support=False)
    contacts = Contacts.of_mesh(rig.chains, rig.points, rig.weights, material.margin)
    solver = ChainSolver(rig.chains, RodTree(rig.chains, material), material.damping, contacts=contacts)
    depths = []
    for met in (None, balls):
        turns = solver.simulate(heads, 1 / 30, met)[0].astype(float)
        points = skin(rig.chains, *pose_chains(rig.chains, from_quaternion(turns)), rig.points, rig.weights)
        depths.append(RADIUS - np.linalg.norm(points - CENTRE, axis=-1).min())
    assert depths[0] > 0.02 and depths[1] < -0.0035, depths


def bowed(rig: HairRig, head: trimesh.Trimesh, quick: float) -> tuple[float, float]:
    """How deep hair is [m], at worst, in a head that bows in 1 / `quick` s: simulated without it and with it."""
    body, frames = np.array(head.vertices) + CENTRE, 60
    joints = np.full((len(body), 1), rig.character.head)
    at = body + rig.character.skeleton.bind[rig.character.head, :3, 3]
    rig = replace(rig, character=replace(rig.character, body=Body(at, head.faces, joints, np.ones_like(joints, float))))
    angles = np.minimum(np.linspace(0, 2 * quick, frames), 1) * np.radians(110)
    heads = np.tile(np.eye(4), (1, frames, 1, 1))
    heads[0, :, :3, :3] = np.stack([from_vector(np.array([angle, 0, 0])) for angle in angles])
    patch = BodyPatch.of(rig, 500)
    met = patch.met(rig, rig.character.skeleton.bind[None, None].repeat(frames, axis=1))
    material = RigMaterial(bend=1e-3, rest_support=False)
    contacts = Contacts.of_mesh(rig.chains, rig.points, rig.weights, material.margin)
    solver = ChainSolver(rig.chains, RodTree(rig.chains, material), material.damping, contacts=contacts)
    exact, depths = Collider(body, head.faces), []
    for hit in (None, met):
        turns = solver.simulate(heads, 1 / 30, hit)[0].astype(float)
        points = skin(rig.chains, *pose_chains(rig.chains, from_quaternion(turns)), rig.points, rig.weights)
        depths.append(-float(exact.distance(points)[0].min()))
    return tuple(depths)


@pytest.mark.parametrize(
    ("head", "quick"),
    [(trimesh.creation.box((0.2, 0.24, 0.2)), 1.0), (trimesh.creation.icosphere(4, RADIUS), 12.0)],
    ids=["a box of twelve faces", "thrown over a ball"],
)
def test_simulated_hair_stays_out_of_the_head(head, quick):
    """Amid large faces, where the nearest vertex says nothing, and where contact has one step to stop it."""
    free, kept = bowed(on_a_ball(), head, quick)
    assert free > 0.02 and -0.009 < kept < 0.004, (free, kept)


def test_a_large_lock_collides_with_more_points():
    """So that no corner of a body fits between them."""
    rig = on_a_ball()
    bun = trimesh.creation.icosphere(3, 0.1).vertices
    weights = np.tile(np.eye(1, len(rig.chains) + 1, 1), (len(bun), 1))
    contacts = Contacts.of_mesh(rig.chains, bun, weights, 0.01)
    mine = contacts.points[contacts.joint == 0]
    gaps = np.linalg.norm(bun[:, None] - mine[None], axis=-1).min(axis=1)
    assert len(mine) > 20 and gaps.max() < 0.045


def test_bones_without_a_mesh_meet_the_body_in_a_simulation():
    """By their ends and middles; networks learn from a mesh alone."""
    rig = on_a_ball()
    bare = replace(rig, points=rig.points[:0], weights=rig.weights[:0])
    bow = [scripted_clip(bare.character, "bow", 2.0)]
    free = replace(bare, character=replace(bare.character, body=None))
    met, not_met = (simulate_motions(some, RigMaterial(bend=1e-4), rig_spec(), bow)[1] for some in (bare, free))
    assert np.abs(met - not_met).max() > 0.01
    assert not PosePool(bare, 2, np.random.default_rng(0)).collides


def test_contacts_are_the_corners_of_each_joint():
    """For a ribbon, first its four corners; for a joint without a mesh, the bone's end."""
    rig = on_a_ball()
    contacts = Contacts.of_mesh(rig.chains, rig.points, rig.weights, 0.01)
    mine = rig.points[rig.weights[:, 1] > 0.5]
    first = contacts.points[contacts.joint == 0][:4]
    extremes = [np.abs(first[:, axis] - mine[:, axis].mean()).min() for axis in (0, 1)]
    np.testing.assert_allclose(extremes, np.ptp(mine[:, :2], axis=0) / 2, atol=1e-9)
    bare = Contacts.of_mesh(rig.chains, rig.points[:0], rig.weights[:0], 0.01)
    np.testing.assert_allclose(bare.points, rig.chains.origins[rig.chains.bone_joint] + rig.chains.bones)


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
        SkinnedMesh("body", body.points, body.triangles, joints, np.ones_like(joints, float)),
        SkinnedMesh("hair", ribbon, np.arange(len(ribbon)).reshape(-1, 3), on, np.ones((len(ribbon), 1))),
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
