# SPDX-License-Identifier: Apache-2.0
"""A bake of hair below a bone that moves on the head."""

import numpy as np
import pytest
from pxr import Usd, UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import hair_turns, model_for, small_shot


def tipped(path):
    """The small shot with its first hair joint as a hat, which nods in place of the head."""
    small_shot(path)
    stage = Usd.Stage.Open(str(path))
    rotations = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
    for code in rotations.GetTimeSamples():
        values = list(rotations.Get(code))
        values[2], values[1] = values[1], values[2]
        rotations.Set(values, code)
    stage.GetRootLayer().Save()
    return path


def test_hair_hangs_as_the_hat_moves_that_carries_it(tmp_path):
    """On a head that stands still; a dynamic model feels it, too."""
    shot = tipped(tmp_path / "hat.usda")
    hair = read_rigged_hair(shot, chains=["hair_1"])
    for dynamic in (False, True):
        result = bake_rig(shot, tmp_path / "out.usda", model_for(hair, dynamic))
        turns = hair_turns(result.path, range(1, 26))[:, 1:]
        assert np.ptp(turns, axis=0).max() > 0.01, "the hair is posed as on a hat that stands still"
        assert not any("does not move" in note for note in result.notes)


def test_a_hat_that_is_hair_of_the_model_is_none(tmp_path):
    """A joint that the bake moves carries nothing: its motion in the shot is overwritten."""
    shot = tipped(tmp_path / "hat.usda")
    with pytest.raises(NeuralocksError, match="its head joint 'head' is not animated"):
        bake_rig(shot, tmp_path / "out.usda", model_for(read_rigged_hair(shot)))
