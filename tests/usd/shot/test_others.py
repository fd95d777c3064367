# SPDX-License-Identifier: Apache-2.0
"""Of a crowd in which one skeleton is named, the others are read only where they may matter to it."""

import pytest
from pxr import Gf, Usd, UsdGeom

from usd.shot.characters import skeletons
from usd.shot.stage import read_shot

from ..shots import Recipe, write_shot

NAMES = ("ann", "bob", "cy")


@pytest.fixture
def read(monkeypatch):
    """Which skeletons are read."""
    paths, plain = [], skeletons.read_rig

    def noting(stage, prim, *args, **options):
        paths.append(str(prim.GetPath()))
        return plain(stage, prim, *args, **options)

    monkeypatch.setattr(skeletons, "read_rig", noting)
    return paths


def _crowd(folder, bound: str, apart: float = 3.0) -> str:
    write_shot(folder, Recipe(bound=bound), "asset")
    stage = Usd.Stage.CreateNew(str(folder / "crowd.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for i, name in enumerate(NAMES):
        UsdGeom.Xform.Define(stage, f"/{name}").AddTranslateOp().Set(Gf.Vec3d(3 + apart * i, 0, 0))
        stage.DefinePrim(f"/{name}/Model").GetReferences().AddReference("./asset.usda")
    stage.Save()
    return stage.GetRootLayer().realPath


def test_what_is_bound_elsewhere_is_left_out_unread(tmp_path, read):
    shot = read_shot(_crowd(tmp_path, "own"), skeleton="/bob/Model/Rig")
    assert [item.path for item in shot.grooms] == ["/bob/Model/Hair"]
    assert read == ["/bob/Model/Rig"]
    assert [note for note in shot.notes if "left out" in note] == [
        f"/{name}/Model/Hair: is bound to /{name}/Model/Rig; left out, or name it with --groom"
        for name in ("ann", "cy")
    ]


@pytest.mark.parametrize("bound", ["mesh", "none"])
def test_what_lies_far_from_a_named_skeleton_is_left_out_without_its_own(tmp_path, read, bound):
    """Hair near to it may belong to others: they are read once, for all of the hair there."""
    path = _crowd(tmp_path, bound)
    whole = {item.path: item for item in read_shot(path).grooms}
    read.clear()
    shot = read_shot(path, skeleton="/bob/Model/Rig")
    assert sorted(read) == ["/ann/Model/Rig", "/bob/Model/Rig", "/bob/Model/Rig", "/cy/Model/Rig"]
    (item,) = shot.grooms
    assert (item.path, item.attachment.how) == ("/bob/Model/Hair", whole["/bob/Model/Hair"].attachment.how)
    assert (item.attachment.to_bind == whole["/bob/Model/Hair"].attachment.to_bind).all()
    told = [note for note in shot.notes if "left out" in note]
    assert len(told) == 2 and all("m from the head of /bob/Model/Rig; left out" in note for note in told)


def test_the_other_skeletons_of_a_named_person_are_read(tmp_path, read):
    """Hair is kept out of their meshes, too."""
    counts = []
    for apart in (2.0, 0.0):
        (tmp_path / f"{apart}").mkdir()
        (groom,) = read_shot(_crowd(tmp_path / f"{apart}", "own", apart), skeleton="/ann/Model/Rig").grooms
        counts.append(len(groom.attachment.character.body.points))
    assert counts[1] == 3 * counts[0]


def test_a_skeleton_without_hair_in_a_crowd_is_told_so(tmp_path):
    path = _crowd(tmp_path, "own")
    stage = Usd.Stage.Open(path)
    stage.GetPrimAtPath("/bob/Model/Hair").SetActive(False)
    stage.Save()
    with pytest.raises(skeletons.NeuralocksError, match="^/bob/Model/Rig: carries no groom; choose another skeleton"):
        read_shot(path, skeleton="/bob/Model/Rig")


def test_a_skeleton_whose_own_hair_lies_elsewhere_is_told_so(tmp_path):
    path = _crowd(tmp_path, "none")
    stage = Usd.Stage.Open(path)
    UsdGeom.Xformable(stage.GetPrimAtPath("/bob/Model/Hair")).AddTranslateOp().Set(Gf.Vec3d(0, 0, 5))
    stage.Save()
    with pytest.raises(
        skeletons.NeuralocksError, match="^/bob/Model/Hair: lies 4.99 m from joint 'head' of /bob/.* no skin"
    ):
        read_shot(path, skeleton="/bob/Model/Rig")


def test_a_skeleton_whose_hair_is_bound_to_what_cannot_be_used_is_told_so(tmp_path):
    path = _crowd(tmp_path, "own")
    stage = Usd.Stage.Open(path)
    stage.GetPrimAtPath("/bob/Model/Hair").SetActive(False)
    stage.GetPrimAtPath("/cy/Model/Rig").GetAttribute("joints").Set([])
    stage.Save()
    with pytest.raises(
        skeletons.NeuralocksError, match="^/cy/Model/Hair: is bound to /cy/Model/Rig, which cannot be used"
    ):
        read_shot(path, skeleton="/bob/Model/Rig")
