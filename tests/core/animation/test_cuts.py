# SPDX-License-Identifier: Apache-2.0
"""Cuts are where a character is put elsewhere; nothing that a body can do is one."""

from dataclasses import replace

import numpy as np
import pytest

from neuralocks_core.animation.cuts import find_cuts, find_flashes
from neuralocks_core.animation.gestures import KINDS
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.motion import Clip
from neuralocks_core.rig import rig_spec
from neuralocks_core.rotation import from_vector
from tests.core.rig.builders import character


def walking(rate=24, seconds=2.0):
    """A head that moves at 2 m/s and nods: times, joints and its index."""
    who = character()
    t = np.arange(0, seconds + 1e-9, 1 / rate)
    joints = np.tile(who.skeleton.bind, (len(t), 1, 1, 1))
    joints[:, who.head, 0, 3] += 2 * t
    joints[:, who.head, :3, :3] = from_vector(np.outer(0.5 * np.sin(7 * t), [1, 0, 0]))
    return who, t, joints


@pytest.mark.parametrize("rate", [24, 60])
@pytest.mark.parametrize("turned", [False, True])
def test_a_jump_and_a_turn_on_the_spot_are_cuts(rate, turned):
    who, t, joints = walking(rate)
    late = t > 1
    if turned:
        joints[late, who.head, :3, :3] = from_vector([0, 2.0, 0]) @ joints[late, who.head, :3, :3]
    else:
        joints[late, who.head, 2, 3] += 0.8
    assert find_cuts(Clip(t, joints), who.head) == pytest.approx([t[late][0]])


@pytest.mark.parametrize("size", [0.01, 100.0])
def test_the_size_of_a_head_changes_no_turn(size):
    who, t, joints = walking()
    joints[t > 1, who.head, :3, :3] = from_vector([0, 2.0, 0]) @ joints[t > 1, who.head, :3, :3]
    joints[:, who.head, :3, :3] *= size
    assert find_cuts(Clip(t, joints), who.head) == pytest.approx([t[t > 1][0]])


def test_a_spin_that_begins_from_one_sample_to_the_next_is_no_cut():
    """What follows the first step explains it."""
    who, t, joints = walking()
    spin = 2.0 * np.clip(np.arange(len(t)) - 23, 0, None)
    joints[:, who.head, :3, :3] = from_vector(np.outer(spin, [0, 1, 0]))
    assert not len(find_cuts(Clip(t, joints), who.head))


@pytest.mark.parametrize("first", [1, 2, 3, -3, -2, -1])
def test_cuts_near_the_ends_are_found(first):
    """A bind pose for a frame or two before the action, which starts elsewhere, is common."""
    who, t, joints = walking()
    joints[first:, who.head, 0, 3] += 3
    assert find_cuts(Clip(t, joints), who.head) == pytest.approx([t[first]])


def test_a_held_key_just_before_a_cut():
    """As animators key it: two samples a thousandth of a frame apart."""
    who, t, joints = walking()
    t = np.insert(t, 24, t[24] - 1e-3 / 24)
    joints = np.insert(joints, 24, joints[23], axis=0)
    joints[25:, who.head, 1, 3] += 1
    assert find_cuts(Clip(t, joints), who.head) == pytest.approx([t[25]])


def test_motion_and_damaged_samples_are_no_cuts():
    who, t, joints = walking()
    assert not len(find_cuts(Clip(t, joints), who.head))
    joints[20, who.head, 0, 3] += 3
    damaged = Clip(t, joints)
    assert not len(find_cuts(damaged, who.head)) and find_flashes(damaged, who.head) == pytest.approx(t[[20, 21]])
    for kind in KINDS:
        clip = scripted_clip(who, kind, 4.0, 24.0)
        assert not len(find_cuts(clip, who.head)) and not len(find_flashes(clip, who.head)), kind


def test_stepped_animation_has_no_cuts():
    """Running, on twos: every second step stands still, the others are large."""
    who, t, joints = walking(24)
    joints[:] = joints[np.arange(len(t)) // 2 * 2]
    joints[:, who.head, 0, 3] += 10 * (np.arange(len(t)) // 2 * 2) / 24
    clip = Clip(t, joints)
    assert not len(find_cuts(clip, who.head)) and not len(find_flashes(clip, who.head))


@pytest.mark.parametrize("short", ["before", "after"])
def test_a_jump_beside_a_shorter_step_is_as_far_as_it_is(short):
    """0.6 m in 1/24 s is a cut, 0.6 m/s would not be: distances are compared over the jump's own step."""
    who = character()
    steps = np.full(20, 1 / 24)
    steps[8 if short == "before" else 10] = 1 / 60
    joints = np.tile(who.skeleton.bind, (21, 1, 1, 1))
    joints[10:, who.head, 0, 3] += 0.6
    times = np.cumsum([0, *steps])
    assert find_cuts(Clip(times, joints), who.head) == pytest.approx([times[10]])


@pytest.mark.parametrize(("apart", "cuts"), [(9, 0), (15, 2)])
def test_jumps_that_follow_each_other_within_a_fifth_of_a_second_are_none(apart, cuts):
    who, t, joints = walking(rate=60)
    joints[30:, who.head, 0, 3] += 1
    joints[30 + apart :, who.head, 0, 3] += 1
    clip = Clip(t, joints)
    assert len(find_cuts(clip, who.head)) == cuts
    assert find_flashes(clip, who.head) == pytest.approx(t[[30, 30 + apart]][: 2 - cuts])


def test_a_metre_between_samples_far_apart_is_no_cut():
    who = character()
    joints = np.tile(who.skeleton.bind, (12, 1, 1, 1))
    joints[6:, who.head, 0, 3] += 1
    assert not len(find_cuts(Clip(0.2 * np.arange(12), joints), who.head))


def cut_clip():
    """A character that jumps 5 m aside after a second: who, times, joints before, joints after, clip."""
    who, t, joints = walking(rate=30)
    put = joints.copy()
    put[30:, :, 0, 3] += 5
    clip = Clip(t, put)
    return who, t, joints, put, replace(clip, cuts=find_cuts(clip, who.head))


@pytest.mark.parametrize("spec", [rig_spec(True), BoundarySpec()])
def test_nothing_of_the_way_is_felt(spec):
    """After a cut, a network reads what it would read of that part alone; before it, what it would read without the cut."""
    who, t, joints, put, clip = cut_clip()
    assert clip.cuts == pytest.approx([1.0])
    sampler, alone = BoundarySampler(spec, who, clip), BoundarySampler(spec, who, clip.parts[1])
    after, before = t[30:], t[:30] + 0.001
    np.testing.assert_array_equal(sampler.vectors(after), alone.vectors(after))
    first = BoundarySampler(spec, who, Clip(t[:30], joints[:30]))
    np.testing.assert_array_equal(sampler.vectors(before), first.vectors(before))
    felt = BoundarySampler(spec, who, replace(clip, cuts=())).vectors(after)
    assert np.abs(felt - alone.vectors(after)).max() > 1
    mixed = sampler.vectors(t[::-1], joints=put[::-1])  # in any order
    np.testing.assert_array_equal(mixed[::-1], sampler.vectors(t, joints=put))


def test_held_poses_and_loops_know_no_cuts():
    who, t, _, _, clip = cut_clip()
    for spec, other in ((rig_spec(), clip), (rig_spec(True), replace(clip, loop=True))):
        with_cuts, without = (BoundarySampler(spec, who, c).vectors(t) for c in (other, replace(other, cuts=())))
        np.testing.assert_array_equal(with_cuts, without)
