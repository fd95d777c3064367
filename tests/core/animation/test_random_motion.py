# SPDX-License-Identifier: Apache-2.0
"""Motion that is made up is repeatable, human in size, and starts still."""

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.animation import random_motion
from neuralocks_core.animation.gestures import FOREIGN, GESTURES, KINDS, WILD
from neuralocks_core.animation.puppet import Puppet
from neuralocks_core.animation.random_motion import _posture, check_weights, random_clip, scripted_clip
from neuralocks_core.errors import NeuralocksError
from tests.core.rig.builders import character
from tests.core.rigs import HEAD, person

TURNS = {"shake": 12, "turn": 12, "nod": 12, "bow": 30, "tilt": 12, "hold": 12}
"""How much the head turns at least [degrees]."""
TRAVELS = {"sway": 0.05, "translate": 0.25, "jump": 0.25, "walk": 0.25, "fall_and_stop": 0.25}
"""How far it goes at least [m]."""


def acceleration(clip):
    head = clip.joints[:, HEAD, :3, 3]
    return np.linalg.norm(np.diff(head, 2, axis=0), axis=1) / (clip.times[1] - clip.times[0]) ** 2


def test_the_same_seed_gives_the_same_clip():
    one, two = (random_clip(person(), np.random.default_rng(5), 3.0) for _ in range(2))
    assert np.array_equal(one.joints, two.joints)
    assert not np.array_equal(one.joints, random_clip(person(), np.random.default_rng(6), 3.0).joints)


@pytest.mark.parametrize("seed", range(40))
def test_random_clips_are_rigid_start_still_and_stay_human(seed):
    clip = random_clip(person(), np.random.default_rng(seed), 3.65)
    turns = clip.joints[..., :3, :3]
    assert np.allclose(np.diff(clip.times), 1 / 30) and clip.end == pytest.approx(3.65, abs=0.02)
    assert np.allclose(turns @ turns.swapaxes(-1, -2), np.eye(3), atol=1e-9)
    assert acceleration(clip)[:5].max() < 2.0
    assert acceleration(clip).max() < 250.0


@pytest.mark.parametrize("seed", range(20))
def test_motion_that_stops_midway_is_the_same_until_then_and_keeps_its_pose(seed):
    whole, stopped = (
        random_clip(person(), np.random.default_rng(seed), 3.65, rate=60.0, stops=share) for share in (0.0, 1.0)
    )
    same = np.abs(stopped.joints - whole.joints).max(axis=(1, 2, 3)) < 1e-9
    until = len(same) if same.all() else int(np.argmin(same))
    held = np.abs(stopped.joints - stopped.joints[-1]).max(axis=(1, 2, 3)) < 1e-9
    assert until >= 0.3 * len(same)  # then it slows down for half a second at most, and stands still
    assert held[round(0.65 * len(held)) + 31 :].all()
    assert acceleration(stopped).max() < 250.0


def test_so_many_stop_midway():
    """Their motion before is that of clips without stops, so that one seed compares both."""
    pairs = [
        [random_clip(person(), np.random.default_rng(seed), 3.65, stops=share).joints for share in (0.0, 0.3)]
        for seed in range(80)
    ]
    assert 12 <= sum(not np.array_equal(*pair) for pair in pairs) <= 36


def test_clips_have_up_to_three_gestures_and_some_of_them_more(monkeypatch):
    """One in five is wild; two in five fidget, if they do not hold a pose."""
    done = []
    for kind in GESTURES:
        monkeypatch.setitem(GESTURES, kind, lambda *_, kind=kind: done[-1].add(kind))
    monkeypatch.setattr(random_motion, "_fidget", lambda *_: done[-1].add("fidget"))
    for seed in range(400):
        done.append(set())
        random_clip(person(), np.random.default_rng(seed), 0.1)
    assert np.mean([bool(kinds & {*WILD}) for kinds in done]) == pytest.approx(0.2, abs=0.06)
    assert np.mean(["fidget" in kinds for kinds in done if "hold" not in kinds]) == pytest.approx(0.4, abs=0.08)
    assert not any({"fidget", "hold"} <= kinds for kinds in done)
    counts = np.bincount([len(kinds & {*KINDS}) for kinds in done], minlength=5) / 400
    assert counts[[0, 4]].tolist() == [0, 0] and counts[1:3] == pytest.approx([0.43, 0.4], abs=0.08)
    done.clear()
    for seed in range(40):
        done.append(set())
        random_clip(person(), np.random.default_rng(seed), 0.1, wild=0)
    assert not set.union(*done) & {*WILD}


def test_arms_are_lifted_outward_and_forward():
    """Not into the body, where hair would meet them."""
    who, lowest, highest = character(), [], []
    chest, arms = who.humanoid["upper_chest"], [who.humanoid[f"{side}_lower_arm"] for side in ("left", "right")]
    for seed in range(60):
        puppet = Puppet(who, np.arange(30) / 6)
        _posture(puppet, np.random.default_rng(seed))
        joints = puppet.clip().joints
        elbows = np.einsum("tij,taj->tai", np.linalg.inv(joints[:, chest]), joints[:, arms][..., 3])
        assert (elbows[..., 0] * [1, -1] > 0.1).all() and (elbows[..., 2] > -0.1).all(), seed
        lowest.append(elbows[..., 1].min())
        highest.append(elbows[..., 1].max())
    assert max(highest) - min(lowest) > 0.3


def test_shoulders_rise_a_little_with_the_arms(monkeypatch):
    """Up to 19 degrees, each about the axis that lifts its own arm."""
    turned = {}
    monkeypatch.setattr(Puppet, "turn", lambda puppet, joint, turns: turned.setdefault(joint, turns))
    monkeypatch.setattr(Puppet, "turn_further", lambda puppet, joint, turns: turned.setdefault(joint, turns))
    highest = []
    for seed in range(60):
        puppet = Puppet(character(), np.arange(30) / 6)
        turned.clear()
        _posture(puppet, np.random.default_rng(seed))
        for side, sign in (("left", 1), ("right", -1)):
            arm, shoulder = (turned.get(f"{side}_{part}") for part in ("upper_arm", "shoulder"))
            assert (arm is None) == (shoulder is None)
            if arm is not None:
                x, y, z = (sign * shoulder).T
                assert not x.any() and not y.any() and (z >= 0).all() and (z <= sign * arm[:, 2]).all()
                highest.append(z.max())
    assert 0.25 < max(highest) <= 0.33 and 24 <= len(highest) <= 48


def jumps(weights, seeds):
    """How many random clips lift the hips as only a jump does."""
    clips = (random_clip(person(), np.random.default_rng(seed), 3.65, wild=0, weights=weights) for seed in seeds)
    heights = (clip.joints[:, 0, 1, 3] - clip.joints[0, 0, 1, 3] for clip in clips)
    return sum(bool(height.max() > 0.05 and np.ptp(height) > 0.16) for height in heights)


def test_a_gesture_is_as_frequent_as_it_is_wanted():
    seeds = range(60)
    assert jumps({kind: 0 for kind in KINDS if kind != "jump"}, seeds) == 60
    assert jumps({"jump": 0}, seeds) == 0
    seldom, often = jumps({}, seeds), jumps({"jump": 5}, seeds)
    assert 3 <= seldom <= 18 and 22 <= often <= 40  # one to three of eleven kinds, or of fifteen


@pytest.mark.parametrize(
    "weights, fact",
    [
        ({"bwo": 3}, "--gesture bwo: unknown kind of motion; use shake, "),
        ({"spin": 3}, "--gesture spin: unknown"),
        ({"bow": -1}, "--gesture bow=-1: must be from 0 to 100"),
        ({"bow": np.nan}, "--gesture bow=nan: must be"),
        ({"bow": 101}, "--gesture bow=101: must be"),
        ({kind: 0 for kind in KINDS}, "--gesture: leaves no kind of motion"),
    ],
)
def test_gestures_that_cannot_be_made_are_refused(weights, fact):
    with pytest.raises(NeuralocksError, match=fact):
        check_weights(weights)


@pytest.mark.parametrize("kind", KINDS)
def test_scripted_clips_do_what_they_say_and_end_still(kind):
    clip = scripted_clip(person(), kind)
    head = clip.joints[:, HEAD]
    travel = np.ptp(head[:, :3, 3], axis=0)
    turned = np.degrees(np.arccos(np.clip((np.trace(head[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1))).max()
    assert kind in TURNS | TRAVELS
    if kind in TURNS:
        assert turned > TURNS[kind]
    if kind in TRAVELS:
        assert travel.max() > TRAVELS[kind]
    if kind in ("fall_and_stop", "hold"):
        assert acceleration(clip)[-15:].max() < 1e-6


def test_free_fall_is_free_fall():
    clip = scripted_clip(person(), "fall_and_stop", rate=120.0)
    down = np.diff(clip.joints[:, HEAD, 1, 3], 2) * 120**2
    assert np.median(down[down < -5]) == pytest.approx(-9.81, abs=0.05)


def test_a_spin_turns_the_body_around_and_around_where_it_stands():
    clip = scripted_clip(person(), "spin", rate=120.0)
    root = clip.joints[:, 0, :3, :3]
    steps = rotation.to_vector(root[1:] @ root[:-1].swapaxes(-1, -2))
    assert np.abs(steps[:, [0, 2]]).max() < 1e-9
    assert steps[:, 1].sum() > 4 * np.pi
    assert np.ptp(clip.joints[:, 0, :3, 3], axis=0).max() < 1e-9


def test_a_tumble_lays_the_body_down_about_a_point_that_stays():
    clip = scripted_clip(person(), "tumble", rate=120.0)
    root = clip.joints[:, 0]
    assert root[-1, 1, 1] < 0.0  # beyond lying
    pivot = 0.55 * 1.4
    at = root[:, :3, 3] + pivot * root[:, :3, 1]
    assert np.ptp(at, axis=0).max() < 1e-9


def test_headbanging_is_hard_and_no_random_clip_learns_from_it():
    clip = scripted_clip(person(), "bang")
    pitch = np.arcsin(-clip.joints[:, HEAD, 1, 2])
    beats = np.sum((np.diff(np.sign(np.diff(pitch))) < 0) & (pitch[1:-1] > 0.5))
    assert np.ptp(pitch) > 1.0 and 4 <= beats <= 7
    assert 5.0 < acceleration(clip).max() < 60.0  # below the 6 g beyond which a model sees no more
    assert not set(FOREIGN) & {*KINDS, *WILD}
