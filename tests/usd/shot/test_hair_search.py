# SPDX-License-Identifier: Apache-2.0
"""Which curves are hair of a character that moves."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.review.baked import read_baked
from usd.review.inspect import inspect
from usd.shot.stage import read_shot

from ..shots import HEAD, POSITIONS, Recipe, add_curves, write_shot


def test_curves_out_of_every_heads_reach_are_no_hair_unless_they_are_named(tmp_path):
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="mesh"))))
    roots = np.random.default_rng(0).uniform(-4, 4, (50, 1, 3)) * [1, 0, 1] + [6, 0, 0]
    add_curves(stage, "/Set/Grass", np.concatenate([roots, roots + [0, 0.2, 0]], axis=1))
    stage.GetRootLayer().Save()
    path = stage.GetRootLayer().realPath
    shot = read_shot(path)
    assert [item.path for item in shot.grooms] == ["/Hero/Hair"]
    assert sum("/Set/Grass" in note and "--groom" in note for note in shot.notes) == 1
    facts = inspect(path)
    assert [groom["path"] for groom in facts["grooms"]] == ["/Hero/Hair"] and not facts["stops"]
    assert sum("/Set/Grass" in note for note in facts["spoils"]) == 1
    assert [item.path for item in read_shot(path, ["/Set"]).grooms] == ["/Set/Grass"]
    for number in range(30):
        Sdf.CopySpec(stage.GetRootLayer(), "/Set/Grass", stage.GetRootLayer(), f"/Set/Grass{number}")
    stage.GetRootLayer().Save()
    assert len([note for note in read_shot(path).notes if "Grass" in note or "28 more" in note]) == 4
    stage.RemovePrim("/Set")
    Sdf.CreatePrimInLayer(stage.GetRootLayer(), "/Set")
    add_curves(stage, "/Set/Grass", np.concatenate([roots, roots + [0, 0.2, 0]], axis=1))
    stage.RemovePrim("/Hero/Hair")
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match="/Set/Grass.*not taken for hair"):
        read_shot(path)
    assert len(inspect(path)["stops"]) == 1


@pytest.mark.parametrize(("away", "hair"), [(0.8, True), (1.2, False)])
def test_a_head_has_a_metre_of_reach(tmp_path, away, hair):
    """So has that of a character whose trunk is shorter."""
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(strands=4))))
    assert POSITIONS[HEAD][1] - POSITIONS[0][1] < 0.8
    roots = POSITIONS[HEAD] + [away, 0, 0] + np.random.default_rng(0).uniform(-0.01, 0.01, (9, 1, 3))
    add_curves(stage, "/Set/Tuft", np.concatenate([roots, roots + [0, 0.2, 0]], axis=1))
    stage.GetRootLayer().Save()
    grooms = [item.path for item in read_shot(stage.GetRootLayer().realPath).grooms]
    assert grooms == ["/Hero/Hair", "/Set/Tuft"][: 1 + hair]


def _far(curves):
    UsdGeom.XformCommonAPI(curves).SetTranslate((3, 0, 0))


def _closed(curves):
    curves.GetWrapAttr().Set("periodic")


def _lone_guide(curves):
    curves.CreatePurposeAttr("guide")


@pytest.mark.parametrize("change", [_far, _closed, _lone_guide])
def test_hair_that_was_named_for_its_bake_need_not_be_named_again(tmp_path, still_model, change):
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="none", basis="bspline", strands=1))))
    change(UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")))
    stage.Save()
    path = stage.GetRootLayer().realPath
    with pytest.raises(NeuralocksError, match="/Hero/Hair.* name it with --groom"):
        bake(path, tmp_path / "hair.usdc", still_model)
    out = bake(path, tmp_path / "hair.usdc", still_model, grooms=["/Hero/Hair"], frames="1:3").path
    (item,) = read_baked(out).shot.grooms
    facts = inspect(out)
    assert item.path == "/Hero/Hair" == facts["grooms"][0]["path"] and not facts["stops"]
    assert not any("--groom" in note for note in [*read_baked(out).shot.notes, *facts["spoils"]])


def test_empty_curves_stop_nothing_beside_a_groom(tmp_path):
    stage = Usd.Stage.Open(str(write_shot(tmp_path)))
    UsdGeom.BasisCurves.Define(stage, "/Hero/Empty")
    stage.GetRootLayer().Save()
    path = stage.GetRootLayer().realPath
    shot, facts = read_shot(path), inspect(path)
    assert [item.path for item in shot.grooms] == ["/Hero/Hair"] == [groom["path"] for groom in facts["grooms"]]
    assert any("/Hero/Empty" in note for note in shot.notes) and any("/Hero/Empty" in note for note in facts["spoils"])
    with pytest.raises(NeuralocksError, match="no points"):
        read_shot(path, ["/Hero/Empty"])


def test_a_character_that_stands_still_stops_nothing_beside_one_that_moves(tmp_path):
    for name, frames in (("hero", 9), ("doll", 0)):
        write_shot(tmp_path, Recipe(frames=frames), name)
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name in ("hero", "doll"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(f"./{name}.usda", "/Hero")
    stage.GetRootLayer().Save()
    shot = read_shot(tmp_path / "shot.usda")
    assert [item.path for item in shot.grooms] == ["/hero/Hair"]
    assert any("/doll/Hair" in note and "no animation" in note for note in shot.notes)
    with pytest.raises(NeuralocksError, match="/doll/Rig.*no animation"):
        read_shot(tmp_path / "shot.usda", ["/doll/Hair"])


@pytest.mark.parametrize("hidden", [None, 1, 5])
def test_curves_that_a_scale_of_zero_hides_stop_no_bake_of_others(tmp_path, hidden):
    """All the time, or from some time code on."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Hair", stage.GetRootLayer(), "/Grass")
    scale = UsdGeom.Xformable(stage.GetPrimAtPath("/Grass")).AddScaleOp()
    if hidden is None:
        scale.Set((0, 0, 0))
    else:
        for code in (1, 5, 9):
            scale.Set((0, 0, 0) if code == hidden else (1, 1, 1), code)
    stage.Save()
    when = "" if hidden is None else f" at time code {hidden}"
    said = f"/Grass: its transform{when} has zero scale, so it is not taken for hair; give it a scale above zero"
    shot, facts = read_shot(path), inspect(path)
    assert [item.path for item in shot.grooms] == ["/Hero/Hair"] and not facts["stops"]
    assert all(any(note.startswith(said) for note in notes) for notes in (shot.notes, facts["spoils"]))
    with pytest.raises(NeuralocksError, match=f"^/Grass: its transform{when} has zero scale; give it"):
        read_shot(path, ["/Grass"])


def test_hair_bound_to_a_skeleton_that_cannot_be_used_goes_to_no_other_head(tmp_path):
    write_shot(tmp_path, Recipe(), "hero")
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name, mirror in (("ann", 1), ("bob", -1)):
        prim = stage.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference("./hero.usda", "/Hero")
        scale = UsdGeom.Xformable(prim).AddTransformOp(opSuffix="mirror")
        scale.Set(
            Gf.Matrix4d().SetScale(Gf.Vec3d(mirror, 1, 1))
            * Gf.Matrix4d().SetTranslate(Gf.Vec3d(0.4 * (mirror < 0), 0, 0))
        )
    stage.GetRootLayer().Save()
    path = stage.GetRootLayer().realPath
    for skeleton in (None, "/ann/Rig"):
        shot = read_shot(path, skeleton=skeleton)
        assert [item.path for item in shot.grooms] == ["/ann/Hair"]
        assert any(note.startswith("/bob/Hair: is bound to /bob/") and "left out" in note for note in shot.notes)
    facts = inspect(path)
    assert [groom["path"] for groom in facts["grooms"]] == ["/ann/Hair"]
    with pytest.raises(NeuralocksError, match="/bob/Hair: is bound to /bob/.*cannot be used"):
        read_shot(path, ["/bob/Hair"])
