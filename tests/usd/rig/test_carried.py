# SPDX-License-Identifier: Apache-2.0
"""A bake of hair below a bone that moves on the head."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.review.inspect import inspect
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


@pytest.mark.parametrize("turned", [True, False])
def test_an_offset_that_moves_hair_besides_the_network_is_told(tmp_path, turned):
    """An offset at the place of the next hair joint, which a bake leaves as it is animated."""
    shot = small_shot(tmp_path / "offset.usda")
    stage = Usd.Stage.Open(str(shot))
    chain = "hips/head/hair_0/hair_1_offset/hair_1/end".split("/")
    for path in ("/Who/Rig", "/Who/Motion"):
        stage.GetPrimAtPath(path).GetAttribute("joints").Set(["/".join(chain[: i + 1]) for i in range(6)])
    skeleton, motion = UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig")), stage.GetPrimAtPath("/Who/Motion")
    bind, rest = skeleton.GetBindTransformsAttr().Get(), skeleton.GetRestTransformsAttr().Get()
    bind[3], rest[3], rest[4] = bind[4], rest[4] * rest[3], Gf.Matrix4d(1)
    skeleton.GetBindTransformsAttr().Set(bind)
    skeleton.GetRestTransformsAttr().Set(rest)
    motion = UsdSkel.Animation(motion)
    motion.GetTranslationsAttr().Set([Gf.Vec3f(each.ExtractTranslation()) for each in rest])
    for code in motion.GetRotationsAttr().GetTimeSamples() if turned else ():
        values = motion.GetRotationsAttr().Get(code)
        values[3] = values[1]
        motion.GetRotationsAttr().Set(values, code)
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Hair")).GetJointIndicesPrimvar().Set([2] * 3 + [4] * 3 + [5] * 3)
    stage.GetRootLayer().Save()
    hair = read_rigged_hair(shot)
    assert hair.rig.chains.names == ("hair_0", "hair_1")
    told = (
        "/Who/Rig: 'hair_1_offset' is animated and moves hair besides the network; clear its keys unless that is wanted"
    )
    for notes in (bake_rig(shot, tmp_path / "out.usda", model_for(hair)).notes, inspect(shot)["spoils"]):
        assert (told in notes) == turned
