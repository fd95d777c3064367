# SPDX-License-Identifier: Apache-2.0
"""A character that is a reference to another one in the same shot takes over what a bake says of that one: a note tells it."""

import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel

from usd.baking.bake import bake
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import model_for, small_shot
from ..shots import Recipe, samples, write_shot


def copied(path, name, instance=False):
    """A shot with a second character beside the first, which stands still."""
    stage = Usd.Stage.Open(str(path))
    second = stage.DefinePrim(f"/{name}2", "SkelRoot")
    second.GetReferences().AddInternalReference(f"/{name}")
    UsdGeom.Xformable(second).AddTranslateOp().Set((3, 0, 0))
    if instance:
        second.SetInstanceable(True)
    return stage


@pytest.mark.parametrize("instance", [False, True])
def test_hair_that_is_left_out_is_told_to_change(tmp_path, still_model, instance):
    path = write_shot(tmp_path, Recipe(frames=3))
    copied(path, "Hero", instance).Save()
    told = "/Hero2/Hair: references or inherits /Hero/Hair in this shot, so it changes as that is baked"
    done = bake(path, tmp_path / "one.usdc", still_model, skeleton="/Hero/Rig")
    assert [note for note in done.notes if note.startswith(told)]
    first, second = (samples(done.path, "points", at=2, prim=f"/{name}/Hair") for name in ("Hero", "Hero2"))
    assert (first == second).all()
    assert not any(told in note for note in bake(path, tmp_path / "both.usdc", still_model).notes)


def test_a_body_that_is_left_out_is_told_to_change(tmp_path):
    path = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(path), dynamic=True)
    stage = copied(path, "Who")
    motion = UsdSkel.Animation(stage.OverridePrim("/Who2/Motion")).CreateRotationsAttr()
    for code in (1, 25):
        motion.Set([Gf.Quatf(1)] * 6, code)
    stage.Save()
    for skeleton in (None, "/Who/Rig"):
        done = bake_rig(path, tmp_path / "bake.usda", model, skeleton=skeleton)
        assert [each.skeleton for each in done.rigs] == ["/Who/Rig"]
        assert any(note.startswith("/Who2/Rig: references or inherits /Who/Rig in this shot") for note in done.notes)
