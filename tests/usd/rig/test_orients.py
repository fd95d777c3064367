# SPDX-License-Identifier: Apache-2.0
"""Bind poses whose joints have a scale that no rotation can be written for."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.review.facts_text import as_text
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import model_for, small_shot


def _stretched(joint):
    """A change that makes a joint twice as long along its X as otherwise in the bind pose."""

    def change(stage):
        binds = UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig")).GetBindTransformsAttr()
        values = np.array(binds.Get())
        values[joint, 0, :3] *= 2
        binds.Set(Vt.Matrix4dArray.FromNumpy(values))

    return change


def _squeezed(stage):
    UsdGeom.Xformable(stage.GetPrimAtPath("/Who")).AddScaleOp().Set((1, 2, 1))


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (None, {"mirrored": 3}, "joint 'hair_1' is mirrored in bind pose .negative scale.; apply the scale in the rig"),
        (_stretched(1), {}, "joint 'head' is unevenly scaled in bind pose; apply the scale in the rig"),
        (_stretched(3), {}, "hair joint 'hair_1': unevenly scaled in bind pose .*; apply the scale in the rig"),
        (_squeezed, {}, "the transform of /Who above it is scaled unevenly, and hair joints below it cannot be"),
    ],
    ids=["mirrored", "parent", "joint", "prim"],
)
def test_an_odd_scale_in_the_bind_pose_is_told_by_every_command(tmp_path, change, options, words):
    model = model_for(read_rigged_hair(small_shot(tmp_path / "plain.usda")))
    shot = small_shot(tmp_path / "shot.usda", **options)
    if change:
        stage = Usd.Stage.Open(str(shot))
        change(stage)
        stage.Save()
    for read in (read_rigged_hair, lambda path: bake_rig(path, tmp_path / "out.usda", model)):
        with pytest.raises(NeuralocksError, match=f"^/Who/Rig: {words}"):
            read(shot)
    facts = inspect(shot)
    assert "would stop a rig bake" in as_text(facts) and not facts["skeletons"][0]["hair chains"]
