# SPDX-License-Identifier: Apache-2.0
"""The simulation of joint chains and the spring bones against answers that are known without them."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.reference.spring_bones import SpringSettings, spring_bones
from neuralocks_core.rig import find_chains
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
    heads[0, 1:, 0, 3] = 0.01  # a sudden step aside sets it going
    turns = ChainSolver(chains, tree, 0.0).simulate(heads, 1 / RATE, substeps=4, warm_up=2)[0]
    angles = np.cumsum(2 * np.arcsin(turns[2:, :, 3].astype(float)), axis=1)
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
    heads = np.tile(np.eye(4), (1, 91, 1, 1))
    heads[0, 1:, 0, 3] = 0.01
    sizes = []
    for c in (0.0, damping):
        turns = ChainSolver(chains, RodTree(chains, RigMaterial(bend=1e-9)), c).simulate(heads, 1 / 30, warm_up=2)
        angle = np.abs(2 * np.arcsin(turns[0, :, 0, 3].astype(float)))
        sizes.append([angle[2:32].max(), angle[61:].max()])
    bare, damped = np.array(sizes)
    assert bare[1] / bare[0] > 0.97
    peaks = 59 / 30  # s between the two windows' peaks, within a swing
    assert np.log(damped[0] / damped[1]) == pytest.approx(damping / 2 * peaks, rel=0.15)


def test_spring_bones_follow_those_above_them_in_the_same_frame():
    """The procedure of VRMC_springBone 1.0 on nodes with arbitrary bind axes, from the root to the descendants."""
    chains, step, settings = chain((0.01, -0.05, -0.02), 4), 1 / 60, SpringSettings(1.3, 0.25, 0.4)
    time, rng = step * np.arange(40), np.random.default_rng(0)
    head = Rotation.from_rotvec(np.stack([0.5 * np.sin(5 * time), 0.8 * np.sin(3 * time), 0.2 * time], axis=1))
    heads = np.tile(np.eye(4), (1, len(time), 1, 1))
    heads[0, :, :3, :3], heads[0, :, :3, 3] = head.as_matrix(), np.outer(np.sin(6 * time), [0.2, 0.1, -0.3])
    turns = from_quaternion(spring_bones(chains, heads, step, settings)[0])
    bind = [Rotation.from_rotvec(rng.normal(size=3)) for _ in range(len(chains))]
    axis = [own.inv().apply(bone) for own, bone in zip(bind, chains.bones, strict=True)]
    current = [head[0].apply(origin + bone) for origin, bone in zip(chains.origins, chains.bones, strict=True)]
    previous = current.copy()
    for frame in range(len(time)):
        parent, place, ours = head[frame], heads[0, frame, :3, 3], head[frame]
        for joint, length in enumerate(chains.lengths):
            above = bind[joint - 1] if joint else Rotation.identity()
            local = above.inv() * bind[joint]
            way = chains.origins[joint] - (chains.origins[joint - 1] if joint else 0)
            place = place + parent.apply(above.inv().apply(way))
            tip = current[joint] + (current[joint] - previous[joint]) * (1 - settings.drag)
            tip = tip + step * settings.stiffness * (parent * local).apply(axis[joint]) / length
            tip = tip + step * settings.gravity_power * np.array([0, -1, 0])
            tip = place + (tip - place) * length / np.linalg.norm(tip - place)
            previous[joint], current[joint] = current[joint], tip
            aim = (parent * local).inv().apply(tip - place)
            parent = parent * local * Rotation.align_vectors([aim], [axis[joint]])[0]
            ours = ours * Rotation.from_matrix(turns[frame, joint])
            assert ours.apply(chains.bones[joint]) == pytest.approx(parent.apply(axis[joint]), abs=1e-6)
