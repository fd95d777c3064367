# SPDX-License-Identifier: Apache-2.0
"""The simulators in a wind: hair hangs along gravity and wind together, and moves as on a head that accelerates against it."""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the reference needs warp")

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.reference import simulate, simulate_xpbd
from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.rig import find_chains
from neuralocks_core.rig.kinematics import bone_ends, pose_chains
from neuralocks_core.rig.rods import RigMaterial, RodTree
from neuralocks_core.rotation import from_quaternion
from neuralocks_core.wind import Wind
from tests.core.reference.swinging_heads import groom, sphere
from tests.core.rig.builders import character, tail

DT = 1 / 30
WIND = np.array([4.0, 0.0, -3.0])


def still(frames):
    return np.tile(np.eye(4), (frames, 1, 1))


def accelerated(frames, wind):
    """Heads (T, 4, 4) at rest until `wind` (T, 3) begins, whose acceleration by the solver's differences is -wind."""
    heads = still(frames)
    place, velocity = np.zeros((frames + 2, 3)), np.zeros((frames + 2, 3))  # two frames of rest before the first
    for i in range(2, frames + 2):
        velocity[i] = (-2 * DT * wind[i - 2] + 4 * velocity[i - 1] - velocity[i - 2]) / 3
        place[i] = (2 * DT * velocity[i] + 4 * place[i - 1] - place[i - 2]) / 3
    heads[:, :3, 3] = place[2:]
    return heads


def test_a_limp_strand_hangs_along_gravity_and_wind():
    rest = np.linspace(0, 0.3, 24)[None, :, None] * np.array([0.0, -1.0, 0.0])
    material = {"bend": 1e-9, "damping": 0.0, "weight": 1.5}
    hung = simulate(
        rest, still(1), material=material, rest_support=False, iterations=100, tolerance=1e-8, wind=WIND[None]
    ).points[0, 0]
    along = (hung[-1] - hung[2]) / np.linalg.norm(hung[-1] - hung[2])
    pull = 1.5 * np.array([0, -9.81, 0]) + WIND  # weight is gravity's alone
    assert along == pytest.approx(pull / np.linalg.norm(pull), abs=1e-3)


def test_wind_moves_hair_as_a_head_that_accelerates_against_it_does():
    """With a body that moves along, relative to the head nothing differs."""
    ball, faces = sphere()
    wind = Wind((0, 2, 5), 1.0).at(np.arange(40) * DT)
    wind[:2] = 0
    heads, rest = accelerated(40, wind), groom()
    options = {"triangles": faces, "bind_body": ball, "start": rest, "tolerance": 1e-6, "iterations": 60}
    blown = simulate(rest, still(40), np.tile(ball, (40, 1, 1)), wind=wind, **options).points
    pushed = simulate(rest, heads, ball + heads[:, None, :3, 3], **options).points
    assert np.abs(blown - pushed).max() < 1e-3
    assert np.linalg.norm(blown[-1] - blown[0], axis=-1).max() > 0.05


def test_substeps_feel_wind_between_its_samples():
    wind = Wind((5, 0, 0), 1.0).at(np.arange(30) * DT)
    coarse, fine = (simulate(groom(), still(30), wind=wind, substeps=substeps).points[-1] for substeps in (4, 8))
    assert np.abs(coarse - fine).max() < 0.02


def test_xpbd_feels_the_same_wind():
    """Limp and without a body, both simulators settle where gravity and wind pull."""
    rest = np.linspace(0, 0.2, 24)[None, :, None] * np.array([0.0, -1.0, 0.0])
    wind = np.tile(WIND, (90, 1))
    material = {"bend": 1e-6, "damping": 8.0}
    tip = simulate_xpbd(rest, still(90), material=material, rest_support=False, wind=wind).points[-1, 0, -1]
    true = simulate(rest, still(90), material=material, rest_support=False, wind=wind).points[-1, 0, -1]
    assert np.linalg.norm(tip - true) < 0.02


def test_chains_hang_along_gravity_and_wind():
    chains = find_chains(character(tail(joints=6, at=(0, 1.6, 0), step=(0, -0.05, 0))))
    solver = ChainSolver(chains, RodTree(chains, RigMaterial(bend=1e-9)), 6.0)
    turns = solver.simulate(still(60)[None], DT, wind=np.tile(WIND, (60, 1)), warm_up=200)[0, -1]
    rotations, positions = pose_chains(chains, from_quaternion(turns[None].astype(float)))
    ends = bone_ends(chains, rotations, positions)[0]
    along = (ends[-1] - ends[0]) / np.linalg.norm(ends[-1] - ends[0])
    pull = np.array([0, -9.81, 0]) + WIND
    assert along == pytest.approx(pull / np.linalg.norm(pull), abs=0.02)


@pytest.mark.parametrize("wind", [np.zeros((3, 3)), np.full((4, 3), np.nan), np.zeros(3)])
def test_wind_that_does_not_fit_the_frames_is_refused(wind):
    with pytest.raises(NeuralocksError, match=r"wind: shape .*give finite accelerations \(4, 3\), one for each frame"):
        simulate(groom(strands=2), still(4), wind=wind)
