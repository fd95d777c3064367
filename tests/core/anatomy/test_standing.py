# SPDX-License-Identifier: Apache-2.0
"""Whether a character lies in its bind pose, and how much of its parents' turn is axes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.anatomy.standing import lies, standing

NAMED = {"hips": 0, "head": 1, "left_foot": 2, "right_foot": 3}
UPRIGHT = np.array([[0, 1, 0], [0, 1.6, 0.05], [0.2, 0.1, 0], [-0.2, 0.1, 0]])
FLAT = UPRIGHT[:, [0, 2, 1]]
ON_ALL_FOURS = np.array([[0, 1, 0], [0, 1.1, 1], [0.2, 0.1, 0], [-0.2, 0.1, 0]])
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Places joints with Y up in a stage with Z up."""
SEATED = np.array([[0, 0.1, 0], [0, 0.7, 0], [0.2, 0.1, 0.9], [-0.2, 0.1, 0.9]])


@pytest.mark.parametrize("joints, lying", [(UPRIGHT, False), (FLAT, True), (ON_ALL_FOURS, False), (SEATED, False)])
def test_legs_and_trunk_lie(joints, lying):
    assert lies(joints, Humanoid(NAMED), np.array([0, 1, 0])) == (lying, True)


@pytest.mark.parametrize("axis", ["x", "z"])
@pytest.mark.parametrize("angle", range(0, 360, 30))
def test_by_whatever_angle_parents_turn_a_character_it_stands(axis, angle):
    """Upside down, too: from there, lying is nearer than standing, but not better."""
    placed = Rotation.from_euler(axis, angle, degrees=True).as_matrix()
    for humanoid in (Humanoid(NAMED), Humanoid({"hips": 0, "head": 1})):
        found = standing(placed, UPRIGHT, humanoid, np.array([0, 1.0, 0]))
        np.testing.assert_allclose(found @ [0, 1, 0], [0, 1, 0], atol=1e-9)


@pytest.mark.parametrize("beside, nearest", [(20, True), (-25, True), (40, False)])
def test_where_nothing_tells_what_is_up_parents_turn_by_the_nearest_quarter(beside, nearest):
    """If it is near: `placed` may be anything else."""
    placed = Rotation.from_euler("x", 90 + beside, degrees=True).as_matrix()
    found = standing(placed, UPRIGHT[1:2], Humanoid({"head": 0}), np.array([0, 1.0, 0]))
    np.testing.assert_allclose(found, Z_UP if nearest else placed, atol=1e-9)


def test_without_legs_a_level_trunk_may_be_an_animals():
    trunk = Humanoid({"hips": 0, "head": 1})
    assert lies(ON_ALL_FOURS, trunk, np.array([0, 1, 0])) == (True, False)
    assert lies(UPRIGHT, trunk, np.array([0, 1, 0])) == (False, False)
    assert not lies(UPRIGHT[:1], Humanoid({"head": 0}), np.array([0, 1, 0]))[0]


@pytest.mark.parametrize(
    "names",
    [
        ("hips", "head", "left_foot", "right_foot"),
        ("hips", "head", "left_upper_leg", "right_upper_leg", "left_foot", "right_foot"),
    ],
)
def test_a_root_on_the_floor_is_no_upper_end_of_legs(names):
    """The chains from head and legs meet there in a rig whose thighs are children of its root, or that has controls for them."""
    places = {"hips": (0, 0, 0), "head": (0, 1.6, 0), "upper_leg": (0.1, 0.9, 0), "foot": (0.1, 0.08, 0)}
    joints = np.array([places[name.removeprefix("left_").removeprefix("right_")] for name in names])
    joints *= [[-1 if "right" in name else 1, 1, 1] for name in names]
    humanoid = Humanoid({name: joint for joint, name in enumerate(names)})
    assert np.array_equal(standing(Z_UP, joints, humanoid, np.array([0, 0, 1.0])), Z_UP)
    assert lies(joints, humanoid, np.array([0, 1.0, 0])) == (False, "left_upper_leg" in names)
    # If the legs are known, they show that the parents laid the character down.
    if "left_upper_leg" in names:
        assert np.array_equal(standing(Z_UP, joints, humanoid, np.array([0, 1.0, 0])), np.eye(3))
