# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel says of frames at which a character jumps, without Blender."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from dcc_addon.services.rigs.leaps import leaps_told
from neuralocks_core.animation.cuts import find_cuts
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import from_vector
from tests.core.rigs import moved, person


def test_leaps_are_told_by_their_frames():
    """A cut, and two jumps in succession that are not cuts."""
    frames = np.arange(10, 74)
    joints = np.tile(np.eye(4), (64, 1, 1, 1))
    joints[:, 0, 1, 3] = 0.01 * np.sin(np.arange(64))
    for first in (20, 50, 54):
        joints[first:, 0, 0, 3] += 1.0
    clip = Clip(frames / 24, joints)
    clip = replace(clip, cuts=find_cuts(clip, 0))
    who = SimpleNamespace(head=0, humanoid={}, skeleton=SimpleNamespace(bind=joints[0]))
    cut, flash = leaps_told(clip, who, frames)
    assert cut == "The head jumps to another place at frame 30: hair starts anew there"
    assert flash.startswith("The head jumps at frame 60, 64, less than 0.2 s from one jump to the next")
    still = Clip(frames / 24, np.tile(np.eye(4), (64, 1, 1, 1)))
    for many, named in ((6, "10, 18, 26, 34, 42, 50:"), (7, "10, 18, 26, 34, 42, 50, ...:")):
        (cut,) = leaps_told(replace(still, cuts=still.times[: 8 * many : 8]), who, frames)
        assert named in cut
    assert leaps_told(still, who, frames) == ()


def test_a_motion_that_leaps_out_of_the_rest_pose_is_told_once():
    """As files from FBX begin; one that leaves the rest pose slowly is not told, nor one that starts anew there."""
    frames = np.arange(10, 58)

    def leaps(turns, cuts=()) -> tuple[str, ...]:
        clip = moved(frames / 24, head_turn=lambda _: from_vector(turns[:, None] * [1.0, 0, 0]))
        return leaps_told(replace(clip, cuts=np.array(cuts)), person(), frames)

    goes_on = np.radians(np.append(0.0, 40 + 15 * np.sin(np.arange(47) / 6)))
    (told,) = leaps(goes_on)
    assert told.startswith("The motion leaps out of the rest pose at frame 11 and flings the hair")
    assert leaps(np.radians(40) * np.sin(np.arange(48) / 24)) == ()
    assert [each.startswith("The head jumps") for each in leaps(goes_on, [11 / 24])] == [True]
