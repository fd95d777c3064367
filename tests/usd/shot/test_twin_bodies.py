# SPDX-License-Identifier: Apache-2.0
"""Unbound hair of characters that have the same body: all of it lies where each of them has its bind pose."""

import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from usd.shot.stage import read_shot

from ..shots import Recipe, write_shot


def _twins(folder, places: dict[str, float], grooms):
    """A shot of characters at these places along X [m], and outside of them a groom of each name."""
    asset = Usd.Stage.Open(str(write_shot(folder, Recipe(bound="mesh"), "asset")))
    hair = Sdf.Layer.CreateAnonymous()
    Sdf.CreatePrimInLayer(hair, "/Hair")
    Sdf.CopySpec(asset.GetRootLayer(), "/Hero/Hair", hair, "/Hair")
    asset.RemovePrim("/Hero/Hair")
    asset.Save()
    stage = Usd.Stage.CreateNew(str(folder / "twins.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, "Y")
    for name, x in places.items():
        path = Sdf.Path(f"/World/Cast/{name}/Model")
        stage.DefinePrim(path).GetReferences().AddReference("./asset.usda")
        UsdGeom.Xform.Define(stage, path.GetParentPath()).AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
    for name in grooms:
        stage.DefinePrim(f"/World/Grooms/{name}")
        Sdf.CopySpec(hair, "/Hair", stage.GetRootLayer(), f"/World/Grooms/{name}/Hair")
    stage.GetRootLayer().Save()
    return folder / "twins.usda"


def _carriers(shot):
    return {item.path.split("/")[3]: item.attachment.rig.path.split("/")[3] for item in shot.grooms}


@pytest.mark.parametrize("grooms", [("alice", "bob"), ("AliceHair", "BobHair")], ids=str)
@pytest.mark.parametrize("places", [{"alice": 0.0, "bob": 2.0}, {"bob": 0.0, "alice": 2.0}, {"bob": 1, "alice": 3}])
def test_hair_that_is_named_like_a_twin_is_that_ones(tmp_path, places, grooms):
    path = _twins(tmp_path, places, grooms)
    shot = read_shot(path)
    assert _carriers(shot) == dict(zip(grooms, ("alice", "bob"), strict=True))
    assert not any("/World/Grooms" in note for note in shot.notes)
    for name, groom in zip(("alice", "bob"), grooms, strict=True):
        shot = read_shot(path, skeleton=f"/World/Cast/{name}/Model/Rig")
        assert _carriers(shot) == {groom: name}
        assert sum("is carried by /World/Cast/" in note for note in shot.notes) == 1


def test_hair_of_twins_that_nothing_tells_apart_is_refused_until_its_skeleton_is_named(tmp_path):
    path = _twins(tmp_path, {"alice": 1.0, "bob": 3.0}, ["one"])
    with pytest.raises(NeuralocksError, match=r"2 skeletons \(.*alice.*bob.*\); choose one with --skeleton PRIM"):
        read_shot(path)
    for name in ("alice", "bob"):
        assert _carriers(read_shot(path, skeleton=f"/World/Cast/{name}/Model/Rig")) == {"one": name}


def test_hair_where_one_of_the_twins_stands_is_its_and_that_is_told(tmp_path):
    shot = read_shot(_twins(tmp_path, {"alice": 2.0, "bob": 0.0}, ["one"]))
    assert _carriers(shot) == {"one": "bob"}
    (note,) = (note for note in shot.notes if note.startswith("/World/Grooms/one/Hair: "))
    assert "taken as hair of /World/Cast/bob/Model/Rig" in note and "/World/Cast/alice/Model/Rig" in note


def test_one_person_in_two_skeletons_is_no_pair_of_twins(tmp_path):
    shot = read_shot(_twins(tmp_path, {"face": 0.0, "body": 0.0}, ["one"]))
    assert _carriers(shot) == {"one": "face"}
    assert not any(note.startswith("/World/Grooms/one/Hair: ") for note in shot.notes)
