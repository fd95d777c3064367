# SPDX-License-Identifier: Apache-2.0
"""How a body lies in the axes of its joints is found in real motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from neuralocks_core.anatomy.upright import standing_axis, upright
from neuralocks_core.character import Character
from neuralocks_core.formats.bvh import read_bvh
from neuralocks_core.rotation import angle_between
from tests.shared_data import SHARED

REAL = SHARED / "motion"
PARTS = ("upper_arm", "upper_leg", "lower_leg")
KNOWN = ("hips", "head", *(f"{side}_{part}" for side in ("left", "right") for part in PARTS))


@pytest.mark.skipif(not REAL.is_dir(), reason="the shared motion capture is not there")
@pytest.mark.parametrize("file", ["02_01", "60_01_scaled"])
def test_with_any_axes_of_its_joints_a_walker_stands(file):
    """Its skeletons also have several trunk joints at one place."""
    source = read_bvh(REAL / f"{file}.bvh")
    skeleton, humanoid = source.skeleton, Character(source.skeleton).humanoid
    axes = Rotation.create_group("O").as_matrix()[np.random.default_rng(1).integers(0, 24, len(skeleton.names))]
    world, rest = source.clip.joints.copy(), np.tile(np.eye(4), (len(axes), 1, 1))
    world[..., :3, :3] = world[..., :3, :3] @ axes
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            bone = skeleton.bind[joint, :3, 3] - skeleton.bind[parent, :3, 3]
            rest[joint, :3, 3] = rest[parent, :3, 3] + axes[parent].T @ bone
    assert standing_axis(rest[:, :3, 3], humanoid) is None
    found = upright(rest, world, skeleton.parents, humanoid)
    assert found.up == "Y" and found.guessed and found.world is world
    turns = found.rest[:, :3, :3] @ np.swapaxes(axes, -1, -2)
    off = np.degrees(angle_between(turns, skeleton.bind[:, :3, :3]))
    assert {name: off[humanoid[name]] for name in KNOWN if off[humanoid[name]] > 1} == {}


def test_one_leg_up_and_one_down_is_no_stand():
    """Bones of one side may point along an axis of their joints, those of the other against it."""
    places = np.array([[0, 1, 0], [0, 1.6, 0], [0.1, 1.8, 0], [-0.1, 0.2, 0.0]])
    humanoid = {"hips": 0, "head": 1, "left_foot": 2, "right_foot": 3}
    assert standing_axis(places, humanoid) is None
    assert standing_axis(places[:, [1, 0, 2]], humanoid) is None
    places[2, 1] = 0.2
    assert np.array_equal(standing_axis(places, humanoid), [0, 1, 0])
    assert np.array_equal(standing_axis(places[:, [1, 0, 2]] * [-1, 1, 1], humanoid), [-1, 0, 0])


def test_a_head_alone_stands():
    places = np.array([[0, 1, 0], [0.1, 0.9, 0], [-0.1, 0.9, 0]])
    humanoid = {"hips": 0, "head": 0, "left_upper_arm": 1, "right_upper_arm": 2}
    assert np.array_equal(standing_axis(places, humanoid), [0, 1, 0])
