# SPDX-License-Identifier: Apache-2.0
"""Hand-written motion: bodies in the air fall freely, arms turn about what they hang from."""

import numpy as np

from neuralocks_core.animation.puppet import FRONT, SIDE, Puppet, leap
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
