# SPDX-License-Identifier: Apache-2.0
"""The simulation of joint chains against answers that are known without it."""

import numpy as np
import pytest
import trimesh
from scipy.linalg import eigh
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from neuralocks_core.body.surface_samples import SurfaceSamples
from neuralocks_core.reference.chain_contact import BodyMesh, Contacts
from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.rig import find_chains
from neuralocks_core.rig.kinematics import bone_ends, pose_chains
from neuralocks_core.rig.rods import RigMaterial, RodTree
from neuralocks_core.rotation import from_quaternion
from tests.core.rig.builders import character, tail

BONE, RATE = 0.05, 120


def chain(step, joints=5):
    return find_chains(character(tail(joints=joints + 1, at=(0, 1.6, 0), step=step)))


@pytest.mark.parametrize("bend", [1e-9, 2e-2])
def test_a_chain_swings_in_its_own_modes(bend):
    """Small angles a of the bones: mass and stiffness matrices by hand, of a pendulum of many bones and with springs."""
    chains = chain((0, -BONE, 0))
    tree, count = RodTree(chains, RigMaterial(bend=bend)), len(chains)
    reach = BONE * np.tril(np.ones((count, count)))
    mass = reach.T @ np.diag(tree.mass) @ reach
    turn = np.eye(count) - np.eye(count, k=-1)
    hung = 9.81 * BONE * np.diag(np.cumsum(tree.mass[::-1])[::-1])
    squares, shapes = eigh(hung + turn.T @ np.diag(tree.stiffness) @ turn, mass)
    heads = np.tile(np.eye(4), (1, 150, 1, 1))
    heads[0, 2:, 0, 3] = 0.01  # a sudden step aside sets it going
    turns = ChainSolver(chains, tree, 0.0).simulate(heads, 1 / RATE, substeps=4, warm_up=2)[0]
    angles = np.cumsum(2 * np.arcsin(turns[3:, :, 3].astype(float)), axis=1)
    for mode in (0, 1):
        swing = angles @ mass @ shapes[:, mode]
        cross = np.flatnonzero(np.diff(np.sign(swing)))
        at = cross + swing[cross] / (swing[cross] - swing[cross + 1])
        assert RATE / (2 * np.diff(at).mean()) == pytest.approx(np.sqrt(squares[mode]) / (2 * np.pi), rel=0.01)


def test_a_chain_without_support_droops_to_the_least_energy():
    """Level bones that nothing supports, in a plane: springs and weights minimised by a general minimiser."""
    chains = chain((0, 0, -BONE))
    material = RigMaterial(bend=5e-2, rest_support=False)
    tree = RodTree(chains, material)

    def energy(angles):
        bend = 2 * tree.stiffness * np.sin(np.diff(angles, prepend=0) / 2) ** 2
        return bend.sum() - 9.81 * (tree.mass * np.cumsum(BONE * np.sin(angles))).sum()

    wanted = np.diff(minimize(energy, np.zeros(len(chains)), options={"gtol": 1e-9}).x, prepend=0)
    turns = ChainSolver(chains, tree, 5.0).simulate(np.tile(np.eye(4), (1, 90, 1, 1)), 1 / 30)[0, -1]
    assert 2 * np.arcsin(np.linalg.norm(turns[:, 1:], axis=1)) == pytest.approx(wanted, abs=1e-4)
    assert wanted.sum() > 0.4


def test_error_falls_with_the_square_of_the_step():
    """Distances between successive halvings shrink by four on a head that moves as hair can follow."""
    chains = chain((0, -BONE, 0.3 * BONE))
    solver = ChainSolver(chains, RodTree(chains, RigMaterial(bend=1e-2)), 6.0)

    def turns(rate):
        size = np.sin(np.pi * np.arange(rate + 1) / rate) ** 4
        heads = np.tile(np.eye(4), (1, rate + 1, 1, 1))
        heads[0, :, :3, :3] = Rotation.from_rotvec(np.outer(size, [0.1, 0.5, 0.2])).as_matrix()
        heads[0, :, 2, 3] = 0.1 * size
        return solver.simulate(heads, 1 / rate, substeps=1)[0, :: rate // 30].astype(float)

    every = [turns(rate) for rate in (60, 120, 240)]
    coarse, fine = (np.abs(a - b).max() for a, b in zip(every, every[1:], strict=False))
    assert coarse / fine == pytest.approx(4.0, abs=0.8)


def test_only_damping_slows_a_chain():
    """A pendulum of one bone loses exp(-c t / 2) of its swing and next to nothing by steps of 1/60 s."""
    chains, damping = chain((0, -0.3, 0), 1), 2.0
    heads = np.tile(np.eye(4), (1, 92, 1, 1))
    heads[0, 2:, 0, 3] = 0.01
    sizes = []
    for c in (0.0, damping):
        turns = ChainSolver(chains, RodTree(chains, RigMaterial(bend=1e-9)), c).simulate(heads, 1 / 30, warm_up=2)
        angle = np.abs(2 * np.arcsin(turns[0, :, 0, 3].astype(float)))
        sizes.append([angle[3:33].max(), angle[62:].max()])
    bare, damped = np.array(sizes)
    assert bare[1] / bare[0] > 0.97
    peaks = 59 / 30  # s between the two windows' peaks, within a swing
    assert np.log(damped[0] / damped[1]) == pytest.approx(damping / 2 * peaks, rel=0.15)


@pytest.mark.parametrize(("rate", "bend"), [(30, 1e-2), (120, 1e-2), (30, 1e-3)])
def test_hair_of_a_tilted_head_begins_where_it_hangs(rate, bend):
    """Long and soft hair on a head that is bowed from the first sample on: it neither falls nor swings, at any rate of samples."""
    chains = chain((0, -0.06, 0), 8)
    heads = np.tile(np.eye(4), (1, rate // 2, 1, 1))
    heads[0, :, :3, :3] = Rotation.from_rotvec([0.6, 0, 0]).as_matrix()
    turns = ChainSolver(chains, RodTree(chains, RigMaterial(bend=bend)), 6.0).simulate(heads, 1 / rate)[0]
    ends = bone_ends(chains, *pose_chains(chains, from_quaternion(turns.astype(float))))
    assert np.linalg.norm(ends[0, -1] - chains.origins[0] - [0, -0.48, 0]) > 0.2
    assert np.abs(ends - ends[-1]).max() < 5e-4


def test_hair_of_a_head_that_comes_along_flies_with_it():
    """Before the first sample, the head moves as between the first two: at constant velocity nothing happens."""
    chains = chain((0, -BONE, 0.5 * BONE))
    heads = np.tile(np.eye(4), (1, 30, 1, 1))
    heads[0, :, :3, 3] = np.outer(np.arange(30) / 30, [0.5, 0.2, 3.0])
    turns = ChainSolver(chains, RodTree(chains, RigMaterial()), 6.0).simulate(heads, 1 / 30)
    assert np.abs(turns[..., 1:]).max() < 1e-6


def test_a_bone_whirls_as_a_conical_pendulum_does():
    """A limp bone beside the axis about which its head turns steadily: tan a = w^2 (r + L sin a) / g."""
    radius, length, spin = 0.1, 0.3, 4.0
    chains = find_chains(character(tail(joints=2, at=(radius, 1.6, 0), step=(0, -length, 0))))
    out = chains.origins[0, 0]  # the canonical origin is the head joint, on the axis
    heads = np.tile(np.eye(4), (1, 240, 1, 1))
    heads[0, :, :3, :3] = Rotation.from_rotvec(np.outer(spin * np.arange(240) / 40, [0, 1, 0])).as_matrix()
    turns = ChainSolver(chains, RodTree(chains, RigMaterial(bend=1e-9)), 6.0).simulate(heads, 1 / 40)[0, -1]
    end = bone_ends(chains, *pose_chains(chains, from_quaternion(turns[None].astype(float))))[0, 0]
    hung = end - chains.origins[0]
    angle = np.arctan2(np.hypot(hung[0], hung[2]), -hung[1])
    assert np.tan(angle) == pytest.approx(spin**2 * (out + length * np.sin(angle)) / 9.81, rel=0.01)
    assert hung[2] == pytest.approx(0.0, abs=1e-3)  # neither ahead of the head nor behind it


def test_a_wind_as_strong_as_gravity_pulls_as_gravity_does():
    """In world axes, on a head that leans and sways."""
    chains = chain((0, -0.3 * BONE, -BONE))
    tree, pull = RodTree(chains, RigMaterial(bend=5e-3)), np.tile([0, -9.81, 0], (30, 1))
    heads = np.tile(np.eye(4), (1, 30, 1, 1))
    lean = np.outer(0.5 + 0.2 * np.sin(np.arange(30) / 3), [1, 0.5, 0.3])
    heads[0, :, :3, :3] = Rotation.from_rotvec(lean).as_matrix()
    weighed, blown = (ChainSolver(chains, tree, 6.0, weight) for weight in (1.0, 0.0))
    wanted = weighed.simulate(heads, 1 / 30)
    assert np.abs(wanted[..., 1:]).max() > 0.05
    np.testing.assert_allclose(blown.simulate(heads, 1 / 30, wind=pull), wanted, atol=1e-6)


@pytest.mark.parametrize("count", [1, 4])
def test_a_level_bone_is_pressed_into_what_it_lies_on_by_its_weight(count):
    """By g / STIFFNESS, whatever its mass is: a joint's contacts share it."""
    chains, box = chain((0, 0, -BONE), 1), trimesh.creation.box((0.4, 0.1, 0.4))
    end, samples = chains.origins[0] + chains.bones[0], SurfaceSamples(box.vertices, box.faces, 500)
    rest = box.vertices[samples.vertices] + end - [0, 0.1, 0]
    raised = (rest + [0, 0.04, 0])[None, None].repeat(10, axis=1)
    contacts = Contacts(np.zeros(count, int), np.tile(end, (count, 1)), np.full(count, 0.01))
    tree = RodTree(chains, RigMaterial(bend=1e-9, rest_support=False))
    solver = ChainSolver(chains, tree, 6.0, contacts=contacts)
    turns = solver.simulate(np.tile(np.eye(4), (1, 10, 1, 1)), 1 / 60, BodyMesh(samples, raised, rest))[0].astype(float)
    ends = bone_ends(chains, *pose_chains(chains, from_quaternion(turns)))[:, 0]
    np.testing.assert_allclose(end[1] - ends[:, 1], 9.81 / solver.STIFFNESS, rtol=0.02)
