# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones that a chain of joints cannot carry as they are: stretched limbs, mirrored and hidden props."""

import numpy as np
import pytest

from dcc_addon.services.rigs.hidden import unhidden
from dcc_addon.services.rigs.motion import Motion
from dcc_addon.services.rigs.rig import RigArrays
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import from_vector

BONES = ("hips", "head", "upper_arm", "forearm", "hand", "palm", "finger", "tip")
PARENTS = np.array([-1, 0, 0, 2, 3, 4, 5, 6])
FRAMES = np.arange(12)


def _limb(stretch: float):
    """World transforms (12, 8, 4, 4) of an arm that IK stretches, as Stretch To does when it keeps the volume, and of a hand that
    inherits none of the stretch.
    """
    turns = np.cumsum(from_vector(np.random.default_rng(2).normal(size=(12, 8, 3)) * 0.5)[:, :, None], axis=2)[:, :, 0]
    world = np.tile(np.eye(4), (12, 8, 1, 1))
    world[..., :3, :3] = turns
    for joint in range(1, 8):
        offset = world[:, PARENTS[joint], :3, :3] @ (0, 0.2 if joint < 5 else 0.05, 0)
        world[:, joint, :3, 3] = world[:, PARENTS[joint], :3, 3] + offset
        if joint in (2, 3):
            world[:, joint, :3, :3] *= np.array([stretch**-0.5, stretch, stretch**-0.5])
    return world


def _bind():
    return np.tile(np.eye(4), (8, 1, 1))


@pytest.mark.parametrize("stretch", [1.3, 2.0, 6.0, 40.0])
def test_below_a_stretched_limb_nothing_runs_away(stretch):
    """All joints stay in place; for those that cannot keep their shape, the error does not grow down the chain."""
    world = _limb(stretch)
    made = Motion.from_world(FRAMES, 24, 1.0, PARENTS, _bind(), world, np.zeros((12, 0)), head=1).world()
    assert np.abs(made[..., :3, 3] - world[..., :3, 3]).max() < 1e-4
    off = np.linalg.norm((made - world)[..., :3, :3], ord=2, axis=(-2, -1)).max(axis=0)
    assert off[:3].max() < 1e-3
    assert off[4] < 1.1 * min(stretch - 1, 1) and off[5:].max() < 1.1 * off[4]


def test_a_mirrored_prop_keeps_nobody_from_sampling():
    """It stays where it was, with its first axis reversed; for a joint that moves hair, the message names the frame. A hidden one
    is a ten-thousandth as large and turns as its parent does, also below another hidden one.
    """
    world, rig = _limb(1.0), RigArrays("Rig", BONES, PARENTS, _bind())
    world[5:7, 6:, :3, :3] *= -1
    world[8, 7, :3, :3] = 0
    world[9, 6:, :3, :3] = 0
    made = unhidden(world, rig, {0, 1}, FRAMES)
    np.testing.assert_allclose(made[8, 7, :3, :3], 1e-4 * world[8, 6, :3, :3], atol=1e-12)
    np.testing.assert_allclose(made[9, 6:, :3, :3], np.tile(1e-4 * world[9, 5, :3, :3], (2, 1, 1)), atol=1e-12)
    assert np.array_equal(made[5:7, 6:, :3, 0], -world[5:7, 6:, :3, 0])
    assert np.linalg.det(made[..., :3, :3]).min() > 0
    made[5:7, 6:, :3, 0] *= -1
    made[8, 7, :3, :3] = made[9, 6:, :3, :3] = 0
    assert np.array_equal(made, world)
    with pytest.raises(NeuralocksError, match="Rig: bone 'finger' has a negative scale in frame 5"):
        unhidden(world, rig, {0, 1, 6}, FRAMES)
