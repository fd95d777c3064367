# SPDX-License-Identifier: Apache-2.0
"""Shots whose animation shows each pose for two frames."""

import numpy as np
import pytest
from pxr import Usd, UsdSkel

from usd.baking.bake import bake
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import model_for, rotations, small_shot
from ..shots import Recipe, samples, write_shot

NOTE = "its animation holds poses for 2 frames each; hair moves as if the motion were smooth in between"


def on_twos(path, back=0.0):
    """Every second frame gets the previous one's pose; with `back`, by a key this many frames before the next pose."""
    stage = Usd.Stage.Open(str(path))
    motion = next(UsdSkel.Animation(prim) for prim in stage.Traverse() if prim.IsA(UsdSkel.Animation))
    for attribute in (motion.GetTranslationsAttr(), motion.GetRotationsAttr(), motion.GetScalesAttr()):
        for code in [code for code in attribute.GetTimeSamples() if code % 2 == 0]:
            attribute.ClearAtTime(code)
            attribute.Set(attribute.Get(code - 1), code + 1 - back if back else code)
    stage.GetRootLayer().Export(str(path.with_name("twos.usda")))
    return path.with_name("twos.usda")


@pytest.mark.parametrize("back", [0.0, 1e-3])
def test_strands_hold_with_each_pose_and_a_bake_tells_it(tmp_path, model, back):
    shot = on_twos(write_shot(tmp_path, Recipe(frames=23, strands=8)), back)
    done = bake(shot, tmp_path / "bake.usdc", model, frames="1:23", resolve=False)
    assert any(note.endswith(NOTE) for note in done.notes)
    assert any(note.endswith(NOTE) for note in inspect(shot)["spoils"])
    points = {code: samples(done.path, "points", at=code) for code in range(1, 23)}
    for code in range(1, 23, 2):
        assert np.abs(points[code + 1] - points[code]).max() < 1e-5
    assert min(np.abs(points[code + 2] - points[code]).max() for code in range(3, 20, 2)) > 1e-3


def test_joints_hold_with_each_pose_and_a_bake_tells_it(tmp_path):
    shot = on_twos(small_shot(tmp_path / "shot.usda"))
    model = model_for(read_rigged_hair(shot), dynamic=True)
    done = bake_rig(shot, tmp_path / "bake.usda", model)
    assert [note for note in done.notes if note.endswith(NOTE)] == [f"/Who/Rig: {NOTE}"]
    still = bake_rig(shot, tmp_path / "still.usda", model_for(read_rigged_hair(shot)))
    assert not any(note.endswith(NOTE) for note in still.notes), "hair of held poses holds with them anyway"
    stage = Usd.Stage.Open(str(done.path))
    animation = UsdSkel.Animation(stage.GetPrimAtPath(done.rigs[0].animation))
    for code in range(1, 25, 2):
        np.testing.assert_allclose(rotations(animation, code + 1), rotations(animation, code), atol=1e-6)
