# SPDX-License-Identifier: Apache-2.0
"""How a body lies in the axes of its joints is found in real motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.anatomy.rest_from_motion import _rotation
from neuralocks_core.anatomy.upright import standing_axis, upright
from neuralocks_core.character import Character
from neuralocks_core.formats.bvh import read_bvh
from neuralocks_core.rotation import angle_between, from_vector
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
    bones = np.swapaxes(found.rest[:, :3, :3], -1, -2) @ found.rest[:, :3, :3]
    np.testing.assert_allclose(bones, np.tile(np.eye(3), (len(bones), 1, 1)), atol=1e-9)
    below = np.flatnonzero(np.asarray(skeleton.parents) >= 0)
    lengths = [
        np.linalg.norm(pose[below, :3, 3] - pose[np.asarray(skeleton.parents)[below], :3, 3], axis=1)
        for pose in (found.rest, skeleton.bind)
    ]
    np.testing.assert_allclose(*lengths, atol=1e-6)
    turns = found.rest[:, :3, :3] @ np.swapaxes(axes, -1, -2)
    off = np.degrees(angle_between(turns, skeleton.bind[:, :3, :3]))
    assert {name: off[humanoid[name]] for name in KNOWN if off[humanoid[name]] > 1} == {}
    assert max(off[humanoid[f"{side}_foot"]] for side in ("left", "right")) < 20  # soles are laid flat


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


NAMED = {"hips": 0, "head": 1, "left_foot": 2, "right_foot": 3}


def bodies(ways, place=(0, 0, 0)) -> np.ndarray:
    """World transforms (T, 4, 4, 4) of a body that goes from its feet, at a place, along each of some directions (T, 3)."""
    world = np.tile(np.eye(4), (len(ways), len(NAMED), 1, 1))
    world[..., :3, 3] = place + np.array([1.0, 1.6, 0.1, 0.1])[:, None] * np.asarray(ways, float)[:, None]
    return world


@pytest.mark.parametrize("place", [(0, 0, 0), (8, -5, 0)])
@pytest.mark.parametrize("known", [4, 2], ids=["feet", "no feet"])
@pytest.mark.parametrize("up", ["Y", "Z"])
def test_a_motion_tells_which_way_is_up_wherever_it_is(place, known, up):
    """If the rest pose does not: here it bends at the hips."""
    way, rest = np.eye(3)["XYZ".index(up)], bodies([[1, 0, 0]])[0]
    rest[0, :3, 3] = (0.6, 0.6, 0)
    humanoid = Humanoid(dict(list(NAMED.items())[:known]))
    found = upright(rest, bodies([way] * 5, np.array(place)), [-1, 0, 0, 0], humanoid)
    assert found.up == up and found.guessed
    assert standing_axis(found.world[0, :, :3, 3], humanoid).tolist() == [0, 1, 0]


@pytest.mark.parametrize("stands, up", [(5, "Z"), (1, "Y")])
def test_a_rest_pose_tells_which_way_is_up_if_the_motion_ever_stands_so(stands, up):
    """A take of somebody who lies, and a rest pose along an axis that the motion does not share."""
    ways = [[0, 0, 1]] * stands + [[0, 1, 0]] * (100 - stands)
    found = upright(bodies([[0, 0, 1]])[0], bodies(ways), [-1, 0, 0, 0], Humanoid(NAMED))
    assert (found.up, found.guessed) == (up, False)
    assert standing_axis(found.rest[:, :3, 3], Humanoid(NAMED)).tolist() == [0, 1, 0]


def test_the_mean_of_two_turns_is_half_way():
    """How a joint that is no part of a body follows the one that it hangs from."""
    first, way = from_vector(np.array([0.5, -0.8, 0.3])), np.array([0.2, 0.7, -0.4])
    mean = (first + first @ from_vector(2 * way)) / 2
    np.testing.assert_allclose(_rotation(mean), first @ from_vector(way), atol=1e-12)
