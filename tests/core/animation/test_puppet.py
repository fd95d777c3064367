# SPDX-License-Identifier: Apache-2.0
"""Hand-written motion: bodies in the air fall freely, arms turn about what they hang from."""

import numpy as np

from neuralocks_core.animation.puppet import FRONT, SIDE, Puppet, leap, swing
from neuralocks_core.animation.random_motion import _fidget
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.rotation import from_vector
from tests.core.rigs import person


def test_a_leap_is_smooth_and_flies_freely():
    times = np.arange(0, 3, 1e-3)
    height, over = leap(times, 0.5, 0.3, 0.2, 0.15)
    assert abs(height.max() - 0.3) < 1e-6 and abs(height.min() + 0.2) < 1e-6
    acceleration = np.gradient(np.gradient(height, times), times)
    flying = height > 0.01
    assert np.allclose(acceleration[flying], -9.81, atol=0.05)
    assert np.abs(np.diff(acceleration)).max() < 2.0  # no jolt from one millisecond to the next
    assert np.allclose(height[times > over], 0) and np.allclose(height[times < 0.5], 0)


def test_a_further_turn_comes_on_top_of_the_first():
    times = np.zeros(1)
    puppet = Puppet(person(), times)
    first, second = 1.2 * FRONT[None], -0.9 * SIDE[None]
    puppet.turn("head", first)
    puppet.turn_further("head", second)
    puppet.turn_further("tail", second)  # joints that the rig lacks are ignored
    clip = puppet.clip()
    head = clip.joints[0, person().head, :3, :3]
    assert np.allclose(head, (from_vector(second) @ from_vector(first))[0])


def test_a_swing_is_so_many_waves_and_nothing_else():
    times = np.arange(0, 6, 1e-3)
    wave = swing(times, 1.0, 3, 2.0)
    assert not wave[(times < 1) | (times > 2.5)].any() and abs(wave).max() > 0.99
    assert np.count_nonzero(np.diff(np.sign(wave[1001:2500]))) == 5


TRUNK = ("hips", "spine", "chest", "neck", "head")


def bending() -> Character:
    """With two joints that bend: the lowest of its trunk, on which legs would hang, does not."""
    names = ["/".join(TRUNK[: i + 1]) for i in range(5)]
    names += [f"{names[2]}/arm_{side}" for side in "LR"]
    bind = np.tile(np.eye(4), (7, 1, 1))
    bind[:, :2, 3] = [(0, 1), (0, 1.1), (0, 1.3), (0, 1.5), (0, 1.6), (0.2, 1.4), (-0.2, 1.4)]
    return Character(Skeleton(names, np.array([-1, 0, 1, 2, 3, 2, 2]), bind))


def test_joints_share_a_bend_of_the_trunk_and_a_turn_of_the_head():
    turns = []
    for bend in (Puppet.bend_spine, Puppet.turn_neck):
        puppet = Puppet(bending(), np.zeros(1))
        bend(puppet, 0.6 * SIDE[None])
        turns.append(puppet.clip().joints[0, :5, :3, :3])
    for found, angles in zip(turns, ([0, 0.3, 0.6, 0.6, 0.6], [0, 0, 0, 0.2, 0.6])):
        np.testing.assert_allclose(found, from_vector(np.outer(angles, SIDE)), atol=1e-12)


def test_nobody_stands_quite_still():
    """Head, trunk and place waver a little, from a standing start."""
    puppet = Puppet(bending(), np.arange(100) / 30)
    _fidget(puppet, np.random.default_rng(0))
    joints = puppet.clip().joints
    place = joints[:, 0, :3, 3]
    assert np.allclose(joints[0, :5, :3, :3], np.eye(3)) and 0.003 < np.ptp(place, axis=0).max() < 0.2
    for above, joint in ((0, 2), (2, 4)):
        turn = joints[:, above, :3, :3].swapaxes(-1, -2) @ joints[:, joint, :3, :3]
        assert 1 < np.degrees(np.arccos((np.trace(turn, axis1=1, axis2=2) - 1) / 2)).max() < 40
