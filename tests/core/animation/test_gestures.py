# SPDX-License-Identifier: Apache-2.0
"""Gestures turn and move bodies the way their names say, whichever way a rig faces."""

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.animation.gestures import GESTURES, REST, Dice
from neuralocks_core.animation.puppet import FRONT, SIDE, UP
from neuralocks_core.animation.random_motion import random_clip, scripted_clip
from neuralocks_core.errors import NeuralocksError
from tests.core.rig.builders import character
from tests.core.rigs import HEAD, person

LEGS = [
    row
    for side, sign in (("left", 1), ("right", -1))
    for row in (
        (f"{side}_upper_leg", "hips", (0.1 * sign, 0.95, 0)),
        (f"{side}_lower_leg", f"{side}_upper_leg", (0.1 * sign, 0.5, 0)),
        (f"{side}_foot", f"{side}_lower_leg", (0.1 * sign, 0.1, 0)),
    )
]


def test_gestures_of_random_clips_differ_and_those_of_scripted_ones_do_not():
    dice = [Dice(np.random.default_rng(seed), 4.0) for seed in range(50)]
    starts = [each.start() for each in dice]
    assert REST <= min(starts) < 0.6 and 1.7 < max(starts) <= 2.0
    assert {each.sign() for each in dice} == {-1.0, 1.0} and {each.repeats() for each in dice} == {1, 2, 3}
    numbers = [each.between(2, 4) for each in dice]
    assert 2 <= min(numbers) < 2.2 and 3.8 < max(numbers) <= 4
    ways = np.array([each.direction() for each in dice])
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1)
    assert not ways[:, 1].any() and (ways.min(axis=0) < [-0.9, 1, -0.9]).all() and (ways.max(axis=0)[::2] > 0.9).all()
    fixed = [(each.start(), each.sign(), each.repeats(), each.between(2, 4)) for each in [Dice(None, 4.0)] * 2]
    assert fixed == [(0.5, 1.0, 2, pytest.approx(3.1))] * 2


@pytest.mark.parametrize(
    ("kind", "axis", "both"),
    [("shake", UP, True), ("turn", UP, False), ("nod", SIDE, True), ("bow", SIDE, False), ("tilt", FRONT, False)],
)
def test_the_head_turns_about_the_axis_of_its_gesture(kind, axis, both):
    """To both sides, or to one and back, as seen from the hips."""
    rotations = scripted_clip(person(), kind).joints[..., :3, :3]
    turns = rotation.to_vector(rotations[:, 0].swapaxes(-1, -2) @ rotations[:, HEAD])
    about = turns @ axis
    assert np.linalg.norm(turns - np.outer(about, axis), axis=1).max() < 0.3 * np.abs(about).max()
    assert about.max() > 0.2 and (about.min() < -0.2 if both else about.min() > -1e-9)
    assert np.abs(turns[[0, -1]]).max() < 1e-6
    if kind in ("turn", "tilt"):  # there and back, twice
        assert np.count_nonzero(np.diff(about > 0.5 * about.max())) == 4


def test_who_bows_bends_forward_and_down():
    head = scripted_clip(person(), "bow").joints[:, HEAD, :3, 3]
    x, y, z = head[head[:, 1].argmin()]
    assert abs(x) < 1e-9 and y < 1.5 and z > 0.2


@pytest.mark.parametrize(("kind", "comes_back"), [("sway", True), ("translate", False), ("jump", True)])
def test_a_body_moves_level_or_upright_only(kind, comes_back):
    hips = scripted_clip(person(), kind).joints[:, 0, :3, 3] - person().skeleton.bind[0, :3, 3]
    still = hips[:, [0, 2] if kind == "jump" else [1]]
    assert np.abs(still).max() < 1e-9 < 0.05 < np.abs(hips).max()
    assert (np.abs(hips[-1]).max() < 1e-3) == comes_back


def test_legs_and_arms_take_turns_in_a_walk_forward():
    """The knee of the leg that swings forward bends, and only backward."""
    who = character(LEGS)
    clip = scripted_clip(who, "walk", rate=120.0)
    at = {name: clip.joints[:, joint, :3, 3] for name, joint in who.humanoid.items()}
    turn = {name: clip.joints[:, joint, :3, :3] for name, joint in who.humanoid.items()}
    hips = at["hips"]
    assert np.diff(hips[:, 2]).min() > -1e-9 and 0.01 < np.ptp(hips[:, 0]) < 0.05
    assert 0.03 < np.ptp(hips[:, 1]) < 0.15 and hips[:, 1].max() < 1 + 1e-9
    thighs, arms = [], []
    going = slice(200, 360)  # neither starting nor stopping
    for side in ("left", "right"):
        knee = rotation.to_vector(turn[f"{side}_upper_leg"].swapaxes(-1, -2) @ turn[f"{side}_lower_leg"])
        thigh = rotation.to_vector(turn["hips"].swapaxes(-1, -2) @ turn[f"{side}_upper_leg"])[:, 0]
        assert knee[:, 0].max() > 0.3 and knee[:, 0].min() > -1e-9 and np.abs(knee[:, 1:]).max() < 1e-9
        swings_back = (np.gradient(thigh) > 1e-3)[going]
        assert swings_back.any() and knee[going, 0][swings_back].max() < 1e-2
        thighs.append(thigh)
        arms.append((at[f"{side}_lower_arm"] - at[f"{side}_upper_arm"])[:, 2])
    assert np.ptp(thighs[0]) > 0.5 and np.allclose(thighs[0], -thighs[1], atol=1e-9)
    assert np.corrcoef(np.abs(thighs[0][going]), hips[going, 1])[0, 1] < -0.9  # highest where the legs pass each other
    # A thigh turned forward has a negative angle, an arm that is in front lies at a positive place.
    assert all(np.corrcoef(thigh, arm)[0, 1] > 0.9 for thigh, arm in zip(thighs, arms))


def test_a_motion_of_no_such_kind_is_refused():
    with pytest.raises(NeuralocksError, match="^motion 'moonwalk': unknown kind; use shake, .*bang"):
        scripted_clip(person(), "moonwalk")


@pytest.mark.parametrize("kind", GESTURES)
def test_a_rig_that_faces_elsewhere_moves_alike(kind):
    """Its bind pose is turned as a whole, as of a character that faces +X."""
    turn = rotation.from_vector([0, 1.2, 0])
    own, turned = (scripted_clip(who, kind, 4.0).joints for who in (person(), person(turn)))
    np.testing.assert_allclose(turned[..., :3, 3], own[..., :3, 3] @ turn.T, atol=1e-9)
    np.testing.assert_allclose(turned[..., :3, :3], turn @ own[..., :3, :3], atol=1e-9)


def test_random_clips_of_a_rig_that_faces_elsewhere_are_the_same():
    """With arms that hang, and are lifted."""
    turn = np.eye(4)
    turn[:3, :3] = rotation.from_vector([0, -2.0, 0])
    who = character()
    elsewhere = type(who)(type(who.skeleton)(who.skeleton.names, who.skeleton.parents, turn @ who.skeleton.bind))
    for seed in range(4):
        own, other = (random_clip(each, np.random.default_rng(seed), 2.0).joints for each in (who, elsewhere))
        np.testing.assert_allclose(other, turn @ own, atol=1e-9)
