# SPDX-License-Identifier: Apache-2.0
"""What a preview of a bake says."""

from pxr import Usd, UsdGeom

from usd.baking.bake import bake
from usd.review import picture

from ..shots import Recipe, write_shot


def test_it_tells_whose_hair_is_not_drawn(tmp_path, monkeypatch):
    """Of several characters the first is drawn: without a word of it, the other's hair would seem to be lost."""
    monkeypatch.setattr(picture.drawing, "render", lambda scene, path, **_: path)
    hero, both, told = write_shot(tmp_path, Recipe(bound="mesh", strands=4)), tmp_path / "both.usda", []
    stage = Usd.Stage.CreateNew(str(both))
    for name, x in (("Anna", -1.0), ("Bert", 1.0)):
        prim = stage.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference(str(hero), "/Hero")
        UsdGeom.XformCommonAPI(prim).SetTranslate((x, 0, 0))
    stage.SetTimeCodesPerSecond(24)
    stage.Save()
    bake(both, tmp_path / "hair.usda", frames="1:2")
    picture.preview(tmp_path / "hair.usda", "hair.png", tell=told.extend)
    assert told == [
        "/Anna/Rig: the first of 2 characters is drawn; choose another, such as /Bert/Rig, with --skeleton PRIM"
    ]
    told.clear()
    picture.preview(tmp_path / "hair.usda", "hair.png", skeleton="/Bert/Rig", tell=told.extend)
    picture.preview(tmp_path / "hair.usda", "hair.png", grooms=["/Anna/Hair"], tell=told.extend)
    assert told == []
