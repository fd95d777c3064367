# SPDX-License-Identifier: Apache-2.0
"""The simulation of joint chains against answers that are known without it."""

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.rig import find_chains
from neuralocks_core.rig.rods import RigMaterial, RodTree
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
