# SPDX-License-Identifier: Apache-2.0
"""Hair without a binding, on a character whose skeleton cannot be used, beside one whose skeleton can."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.review.inspect import inspect
from usd.shot.stage import read_shot

from ..shots import JOINTS, Recipe, write_shot

APART = 0.45
"""Distance between the two characters [m]: less than hair may have to a head without skin."""


def _mirrored(layer: Sdf.Layer) -> None:
    """Mirror the root, as when a copy of the other side is made."""
    stage = Usd.Stage.Open(layer)
    UsdGeom.Xformable(stage.GetPrimAtPath("/bob")).AddScaleOp().Set((-1, 1, 1))


def _hidden(layer: Sdf.Layer) -> None:
    """Hide a character that waits for its entrance at zero scale, and its hair with it."""
    stage = Usd.Stage.Open(layer)
    UsdGeom.Xformable(stage.GetPrimAtPath("/bob")).AddScaleOp().Set((0, 0, 0))


def _not_finite(layer: Sdf.Layer) -> None:
    bind = list(layer.GetAttributeAtPath("/bob/Rig.bindTransforms").default)
    bind[2] = Gf.Matrix4d(float("nan"))
    layer.GetAttributeAtPath("/bob/Rig.bindTransforms").default = Vt.Matrix4dArray(bind)


def _headless(layer: Sdf.Layer) -> None:
    told = [name.replace("neck/head", "b1/b2").replace("neck", "b1") for name in JOINTS]
    for path in ("/bob/Rig.joints", "/bob/Rig/Motion.joints"):
        layer.GetAttributeAtPath(path).default = Vt.TokenArray(told)


def _two(folder, spoil, bound: str = "mesh") -> Sdf.Layer:
    """The characters ann and, APART beside her, bob with his hair, whose skeleton is spoiled; ann has no hair."""
    layer = Sdf.Layer.FindOrOpen(str(write_shot(folder, Recipe(bound=bound, nesting="/ann"))))
    place = np.eye(4)
    place[0, 3] = APART
    other = Sdf.Layer.FindOrOpen(str(write_shot(folder, Recipe(bound=bound, nesting="/bob", place=place), "bob")))
    Sdf.CopySpec(other, "/bob", layer, "/bob")
    spoil(layer)
    layer.Save()
    return layer


@pytest.mark.parametrize("bound", ["mesh", "none"])
@pytest.mark.parametrize("spoil", [_mirrored, _not_finite, _headless])
def test_hair_on_a_character_that_cannot_be_read_goes_to_no_other_head(tmp_path, spoil, bound):
    path = _two(tmp_path, spoil, bound).realPath
    for skeleton in (None, "/ann/Rig"):
        shot = read_shot(path, skeleton=skeleton)
        assert [item.path for item in shot.grooms] == ["/ann/Hair"]
        assert any(note.startswith("/bob/Hair: lies on the character of /bob/Rig, which") for note in shot.notes)
    facts = inspect(path)
    assert [groom["path"] for groom in facts["grooms"]] == ["/ann/Hair"]
    assert any(note.startswith("/bob/Hair: lies on the character of /bob/Rig, which") for note in facts["spoils"])
    with pytest.raises(NeuralocksError, match="/bob/Hair: lies on the character of /bob/Rig, which cannot be used"):
        read_shot(path, ["/bob/Hair"])
    (item,) = read_shot(path, ["/bob/Hair"], skeleton="/ann/Rig").grooms
    assert item.attachment.rig.path == "/ann/Rig"


@pytest.mark.parametrize(("bound", "how"), [("own", "is bound to"), ("mesh", "lies on"), ("none", "lies on")])
def test_hair_of_a_hidden_character_stops_no_others(tmp_path, bound, how):
    path = _two(tmp_path, _hidden, bound).realPath
    assert [item.path for item in read_shot(path).grooms] == ["/ann/Hair"]
    facts = inspect(path)
    assert [groom["path"] for groom in facts["grooms"]] == ["/ann/Hair"] and not facts["stops"]
    with pytest.raises(NeuralocksError, match=f"/bob/Hair: {how} .*/bob/Rig, which cannot be used"):
        read_shot(path, ["/bob/Hair"])


@pytest.mark.parametrize("at_hand", ["/grooms/Hair", "/ann/Wig"])
def test_skin_tells_whose_hair_it_is_wherever_the_hair_is_kept(tmp_path, at_hand):
    layer = _two(tmp_path, _not_finite)
    Sdf.CreatePrimInLayer(layer, Sdf.Path(at_hand).GetParentPath()).specifier = Sdf.SpecifierDef
    Sdf.CopySpec(layer, "/bob/Hair", layer, at_hand)
    stage = Usd.Stage.Open(layer)
    stage.RemovePrim("/bob/Hair")
    UsdGeom.Xformable(stage.GetPrimAtPath(at_hand)).AddTranslateOp().Set((APART, 0, 0))
    layer.Save()
    shot = read_shot(layer.realPath)
    assert [item.path for item in shot.grooms] == ["/ann/Hair"]
    assert any(note.startswith(f"{at_hand}: lies on the character of /bob/Rig, which") for note in shot.notes)


def test_of_two_who_are_bound_at_one_place_the_hair_of_each_is_its_own(tmp_path):
    """Rigs are bound where they were made; only their animation separates them."""
    layer = _two(tmp_path, _not_finite)
    del layer.GetPrimAtPath("/bob").properties["xformOp:transform"]
    layer.GetAttributeAtPath("/bob.xformOpOrder").default = Vt.TokenArray()
    layer.Save()
    shot = read_shot(layer.realPath)
    assert [item.path for item in shot.grooms] == ["/ann/Hair"]
    assert any(note.startswith("/bob/Hair: lies on the character of /bob/Rig, which") for note in shot.notes)


@pytest.mark.parametrize("joints", [("face_root", "face_root/jaw"), ()])
@pytest.mark.parametrize("scalp", [True, False], ids=["scalp", "face"])
def test_a_face_on_a_rig_of_its_own_takes_no_hair_from_the_head(tmp_path, joints, scalp):
    """Nor does the empty skeleton that an exporter leaves beside the hair."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    layer = Sdf.Layer.FindOrOpen(str(path))
    Sdf.CreatePrimInLayer(layer, "/Hero/Face").specifier = Sdf.SpecifierDef
    Sdf.CopySpec(layer, "/Hero/Hair", layer, "/Hero/Face/Hair")
    Sdf.CopySpec(layer, "/Hero/Skin", layer, "/Hero/Face/Skin")
    stage = Usd.Stage.Open(layer)
    stage.RemovePrim("/Hero/Hair")
    if not scalp:
        stage.RemovePrim("/Hero/Skin")
    rig = UsdSkel.Skeleton.Define(stage, "/Hero/Face/Rig")
    rig.CreateJointsAttr(joints)
    rig.CreateBindTransformsAttr([Gf.Matrix4d(1)] * len(joints))
    rig.CreateRestTransformsAttr([Gf.Matrix4d(1)] * len(joints))
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/Face/Skin")).GetSkeletonRel().SetTargets(["/Hero/Face/Rig"])
    layer.Save()
    shot = read_shot(path)
    assert [(item.path, item.attachment.rig.path) for item in shot.grooms] == [("/Hero/Face/Hair", "/Hero/Rig")]
