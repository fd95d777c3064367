# SPDX-License-Identifier: Apache-2.0
"""What mesh hair does at the body in the simulation of its chains."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

pytest.importorskip("torch")

from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.body.collider import Collider
from neuralocks_core.reference.chain_contact import BodyMesh, Contacts
from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.rig import rig_spec
from neuralocks_core.rig.kinematics import pose_chains, skin
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial, RodTree
from neuralocks_core.rotation import from_quaternion, from_vector
from neuralocks_core.skinned_body import Body
from neuralocks_core.training.rig.body import BodyPatch
from neuralocks_core.training.rig.motion import simulate_motions
from neuralocks_core.training.rig.poses import PosePool
from tests.core.rig.ball_head import CENTRE, RADIUS, on_a_ball


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
