# SPDX-License-Identifier: Apache-2.0
"""What a clip is made of: the animation's samples, and what stands before and after them."""

import numpy as np
import pytest
from pxr import Usd

from neuralocks_core.runtime import StrandModel
from usd.shot.stage import read_shot

from ..shots import Recipe, write_shot


def test_a_pose_is_held_to_the_end_of_the_shot_where_the_animation_begins_before_it(tmp_path):
    """Animation with a run-up, whose exporter left out the samples after the character stopped."""
    path = write_shot(tmp_path, Recipe(frames=9))
    stage = Usd.Stage.Open(str(path))
    stage.SetStartTimeCode(4)
    stage.SetEndTimeCode(30)
    stage.GetRootLayer().Save()
    rig = read_shot(path).rigs[0]
    assert (rig.time_codes[0], rig.time_codes[-1]) == (1, 30)
    np.testing.assert_array_equal(rig.clip.joints[-1], rig.joints_at(9))


@pytest.mark.parametrize("rate", [24.0, 60.0, 1000.0])
def test_a_range_that_begins_a_frame_before_the_samples_is_no_stand(tmp_path, rate):
    """The character begins with the speed that it has; held for 0.1 s it stands."""
    path = write_shot(tmp_path, Recipe(rate=rate, frames=9))
    stage = Usd.Stage.Open(str(path))

    def read(hold):
        stage.SetStartTimeCode(1 - hold * rate)
        stage.Save()
        rig = read_shot(path).rigs[0]
        return rig, StrandModel.load().sampler(rig.character, rig.clip).vectors(rig.border.seconds([-3, 1, 3, 9]))

    (rig, plain), (wider, same), (standing, other) = (read(hold) for hold in (0, 0.09, 0.1))
    np.testing.assert_array_equal(wider.time_codes, rig.time_codes)
    np.testing.assert_array_equal(same, plain)
    np.testing.assert_allclose(standing.time_codes[[0, -1]], [1 - 0.1 * rate, 9])
    assert np.abs(other - plain).max() > 0.1
