# SPDX-License-Identifier: Apache-2.0
"""A reference pose at a clip's beginning is told from a motion that begins in the bind pose."""

import numpy as np
import pytest

from neuralocks_core.animation.reference_pose import reference_end
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import from_vector
from tests.core.rig.builders import character, tail

RATE, COUNT = 24.0, 48
WHO = character(tail("hair", 3))
NAMES = [name.rsplit("/", 1)[-1] for name in WHO.skeleton.names]


def clip(degrees, turned=("head", "left_upper_arm"), before=1, start=None, held=1):
    """Joints that turn by `degrees` (T,) about x, with what hangs from them, after `before` samples of the bind pose, or `start`."""
    bind = WHO.skeleton.bind if start is None else start
    joints = np.tile(WHO.skeleton.bind, (len(degrees), 1, 1, 1))
    for name in turned:
        joint = NAMES.index(name)
        move = np.tile(np.eye(4), (len(degrees), 1, 1))
        move[:, :3, :3] = from_vector(np.outer(np.radians(degrees), [1.0, 0, 0]))
        place = joints[:, joint, :3, 3].copy()
        move[:, :3, 3] = place - np.einsum("tij,tj->ti", move[:, :3, :3], place)
        below = WHO.skeleton.below(joint)
        joints[:, below] = move[:, None] @ joints[:, below]
    joints = np.repeat(np.concatenate([np.tile(bind, (before, 1, 1, 1)), joints]), held, axis=0)
    return Clip(np.arange(len(joints)) / RATE, joints)


def end(motion, *others):
    return reference_end(motion, WHO, [WHO.skeleton.bind, *others])


GOES_ON = 40 + 15 * np.sin(np.arange(COUNT) / 6)
SOFT = 40 * (1 - np.cos(np.minimum(np.arange(COUNT) / 12, 1) * np.pi))


@pytest.mark.parametrize("before", [1, 3, 20])
def test_a_performance_that_goes_on_from_nowhere_is_found(before):
    assert end(clip(GOES_ON, before=before)) == pytest.approx(before / RATE)


def test_hair_and_the_root_may_be_anywhere_in_the_reference_pose():
    """A take is shot where the actor stands; hair joints are animated, or not."""
    motion = clip(GOES_ON)
    move = np.eye(4)
    move[:3, :3], move[:3, 3] = from_vector(np.array([0, 1.2, 0])), (3, 0, 1)
    joints = move @ motion.joints
    hair = WHO.skeleton.below(NAMES.index("hair_1"))
    joints[0, hair, :3, :3] = from_vector(np.array([0.4, 0, 0])) @ joints[0, hair, :3, :3]
    assert end(Clip(motion.times, joints)) == pytest.approx(1 / RATE)


@pytest.mark.parametrize(
    "motion",
    [
        clip(SOFT, before=1),
        clip(SOFT, before=10),
        clip(np.arange(COUNT) * 20.0 + 20, before=1),  # at full speed from the first frame
        clip(GOES_ON, before=0),
        clip(GOES_ON, turned=["left_upper_arm"]),  # hair feels no arm's motion
        clip(GOES_ON / 4),
        clip(GOES_ON, before=60),  # not a reference, but a wait
        clip(GOES_ON, held=2),  # animation on twos
        clip(0 * GOES_ON),
        clip(GOES_ON[:1]),
    ],
    ids="soft waits at_once without arm near wait twos still short".split(),
)
def test_motions_from_the_bind_pose_and_others_are_not(motion):
    assert end(motion) is None


def test_any_given_pose_may_be_the_reference():
    """The rest pose, which is not always the bind pose."""
    rest = clip(np.array([35.0]), turned=["left_upper_arm", "right_upper_arm"], before=0).joints[0]
    motion = clip(GOES_ON, start=rest)
    assert end(motion) is None and end(motion, rest) == pytest.approx(1 / RATE)


def test_steps_as_long_as_a_move_tell_nothing():
    motion = clip(GOES_ON)
    assert end(Clip(motion.times * 4, motion.joints)) is None


def test_hidden_joints_do_not_count():
    motion = clip(GOES_ON)
    motion.joints[:, NAMES.index("right_lower_arm"), :3, :3] = 0
    assert end(motion) == pytest.approx(1 / RATE)


def test_a_pose_that_mirrors_a_joint_stops_nothing():
    rest = clip(GOES_ON).joints[0].copy()
    rest[NAMES.index("right_lower_arm"), :3, 0] *= -1
    assert end(clip(GOES_ON), rest) == pytest.approx(1 / RATE)
