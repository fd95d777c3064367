# SPDX-License-Identifier: Apache-2.0
"""A character that is a reference to another one in the same shot takes over what a bake says of that one: a note tells it."""

import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair
from usd.shot.bakes.also_changed import also_changed
from usd.shot.stage import read_shot
from usd.shot.strands.curves import find_curves

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


def test_one_of_two_instances_of_an_asset_changes_alone(tmp_path):
    """USD composes what instances share at one of them, which stands for all. What the shot says below one in vain is told."""
    asset = write_shot(tmp_path, Recipe(frames=3), "asset")
    stage = Usd.Stage.CreateNew(str(tmp_path / "crowd.usda"))
    for name in ("A", "B"):
        instance = stage.DefinePrim(f"/{name}")
        instance.GetReferences().AddReference(asset.name)
        instance.SetInstanceable(True)
    stage.Save()
    for name in ("A", "B"):
        (item,) = read_shot(tmp_path / "crowd.usda", [f"/{name}/Hair"]).grooms
        assert not also_changed([item.prim], find_curves(item.prim.GetStage()))
    shared = stage.GetPrimAtPath("/A/Hair").GetPrimInPrototype().GetPath()
    with pytest.raises(
        NeuralocksError, match=f"{shared}: is what instances share; the stage's grooms are: /A/Hair, /B/Hair"
    ):
        find_curves(stage, [shared])
    Sdf.CreatePrimInLayer(stage.GetRootLayer(), "/A/Hair").active = False
    stage.Save()
    for name in ("A", "B"):
        (item,) = read_shot(tmp_path / "crowd.usda", [f"/{name}/Hair"]).grooms
        notes = also_changed([item.prim], ())
        assert len(notes) == (name == "A") and all(
            "/A: is an instance, so what crowd.usda says of prims below it (/A/Hair" in note for note in notes
        )


def test_a_set_is_asked_wherever_it_is_referenced(tmp_path):
    """An instance in a set: another copy of the set takes over its bake, and what the set says below it in vain counts then."""
    asset = write_shot(tmp_path, Recipe(frames=3), "asset")
    inner = Usd.Stage.CreateNew(str(tmp_path / "set.usda"))
    instance = inner.DefinePrim("/Set/A")
    instance.GetReferences().AddReference(asset.name)
    instance.SetInstanceable(True)
    inner.DefinePrim("/Copy").GetReferences().AddInternalReference("/Set")
    over = Sdf.CreatePrimInLayer(inner.GetRootLayer(), "/Set/A/Skin")
    inner.Save()

    def notes(stage, path) -> list[str]:
        return also_changed([stage.GetPrimAtPath(path)], find_curves(stage))

    for path, copies in (("/Set/A/Hair", ["/Copy/A/Hair: references"]), ("/Copy/A/Hair", [])):
        for _ in range(8):  # USD composes what instances share at any one of them
            said = notes(Usd.Stage.Open(inner.GetRootLayer().realPath), path)
            assert [note[: len("/Copy/A/Hair: references")] for note in said] == copies, (
                "an over that says nothing is not told"
            )
    over.active = False
    inner.Save()
    shot = Usd.Stage.CreateInMemory()
    shot.DefinePrim("/World").GetReferences().AddReference(inner.GetRootLayer().realPath, "/Set")
    (said,) = notes(shot, "/World/A/Hair")
    assert said.startswith("/World/A: is an instance, so what set.usda says of prims below it (/Set/A/Skin")


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
