# SPDX-License-Identifier: Apache-2.0
"""All joints between the samples of a clip go as the network reads the head."""

import numpy as np
import pytest

from neuralocks_core import rotation
from neuralocks_core.boundary.smooth_motion import SmoothMotion
from neuralocks_core.boundary.track import Track
from neuralocks_core.motion import Clip

from .. import rigs

TIMES = np.arange(25) / 24


def clip(loop=False):
    """The body goes forward and bobs, the head shakes; a whole number of cycles in the clip."""
    turn = 2 * np.pi * TIMES / TIMES[-1]
    joints = np.tile(rigs.bind(), (len(TIMES), 1, 1, 1))
    joints[:, :, 0, 3] += 0.3 * TIMES[:, None] + 0.05 * np.sin(turn)[:, None]
    joints[:, rigs.HEAD, :3, :3] = 1.5 * rotation.from_vector(np.outer(2.5 * np.sin(turn), [0.3, 1, 0.2]))
    return Clip(TIMES, joints, loop=loop)


@pytest.mark.parametrize("loop", (False, True))
def test_the_head_goes_as_the_network_reads_it(loop):
    character, motion = rigs.person(), clip(loop)
    times = np.linspace(-1.2, 3.3, 200)
    place, turn = Track(character, motion, [rigs.HEAD]).at(times)
    found = SmoothMotion(rigs.person(), motion).at(times)[:, rigs.HEAD]
    np.testing.assert_allclose(found[:, :3, 3], place, atol=1e-12)
    np.testing.assert_allclose(found[:, :3, :3], 1.5 * turn[:, 0], atol=1e-9)


def test_samples_come_back_before_them_all_comes_on_without_turning_and_after_them_it_stands():
    motion = clip()
    smooth = SmoothMotion(rigs.person(), motion)
    np.testing.assert_allclose(smooth.at(TIMES), motion.joints, atol=1e-12)
    outside, step = smooth.at(np.array([-1.0, -0.5, 1.5, 2.0])), smooth.at(np.array([0.0, 1e-6]))
    np.testing.assert_allclose(outside[..., :3, :3], motion.joints[[0, 0, -1, -1], :, :3, :3], atol=1e-12)
    gone, speed = (np.diff(joints[:2, ..., :3, 3], axis=0) for joints in (outside, step))
    np.testing.assert_allclose(gone / 0.5, speed / 1e-6, atol=1e-5)
    np.testing.assert_allclose(outside[2:], motion.joints[[-1, -1]], atol=1e-12)
    alone = Clip(TIMES[:1], motion.joints[:1])
    np.testing.assert_allclose(
        SmoothMotion(rigs.person(), alone).at(TIMES), motion.joints[:1].repeat(25, axis=0), atol=1e-12
    )


def test_mirrored_and_flat_joints_keep_nobody_from_moving():
    motion = clip()
    odd = motion.joints.copy()
    odd[:, 4, :3, :3] = odd[:, rigs.HEAD, :3, :3] * [1, 1, -1]
    odd[:, 5, :3, :3] = 0
    between = TIMES[:-1] + 0.4 / 24
    found, plain = (SmoothMotion(rigs.person(), Clip(TIMES, joints)).at(between) for joints in (odd, motion.joints))
    np.testing.assert_allclose(found[:, 4, :3, :3], plain[:, rigs.HEAD, :3, :3] * [1, 1, -1], atol=1e-3)
    assert not found[:, 5, :3, :3].any()
    np.testing.assert_allclose(found[:, :4], plain[:, :4], atol=1e-12)
