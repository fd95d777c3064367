# SPDX-License-Identifier: Apache-2.0
"""Hair is kept out of all meshes of a character in several skeletons, as if one skinned them."""

from types import SimpleNamespace

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from usd.baking.bake import bake
from usd.review.inspect import inspect
from usd.shot.notes.skeleton_notes import partial_body
from usd.shot.stage import read_shot

from ..shots import HAIR, Recipe, world_points, write_shot


def _apart(folder, rename=None, **recipe):
    """A shot whose character has its mesh on a second skeleton, with joints of other names if told."""
    path = write_shot(folder, Recipe(**recipe), "apart")
    layer = Sdf.Layer.FindOrOpen(str(path))
    Sdf.CopySpec(layer, "/Hero", layer, "/Coat")
    stage = Usd.Stage.Open(layer)
    stage.RemovePrim("/Coat/Hair")
    stage.RemovePrim("/Hero/Skin")
    for prim in Usd.PrimRange(stage.GetPrimAtPath("/Coat")):
        for relation in prim.GetRelationships():  # copied with their targets
            relation.SetTargets([path.ReplacePrefix("/Hero", "/Coat") for path in relation.GetTargets()])
    if rename:
        for prim in Usd.PrimRange(stage.GetPrimAtPath("/Coat")):
            for kind in (UsdSkel.Skeleton, UsdSkel.Animation):
                if prim.IsA(kind):
                    attribute = kind(prim).GetJointsAttr()
                    attribute.Set([rename(name) for name in attribute.Get()])
    layer.Save()
    return path


@pytest.mark.parametrize("recipe", [{}, {"unit": 0.01, "up": "Z"}])
def test_hair_moves_as_if_one_skeleton_skinned_all(tmp_path, model, recipe):
    whole = bake(write_shot(tmp_path, Recipe(**recipe), "whole"), tmp_path / "whole.usdc", model).path
    result = bake(_apart(tmp_path, **recipe), tmp_path / "apart_hair.usdc", model)
    free = bake(tmp_path / "apart.usda", tmp_path / "free.usdc", model, resolve=False).path
    for code in (1.0, 5.0, 9.0):
        assert world_points(result.path, code) == pytest.approx(world_points(whole, code), abs=1e-6)
    assert np.abs(world_points(free, 5.0) - world_points(whole, 5.0)).max() > 1e-3, "nothing was pushed"
    assert not any("body" in note for note in result.notes), result.notes


@pytest.mark.parametrize(
    "named", [{"grooms": [HAIR]}, {"skeleton": "/Hero/Rig"}, {"grooms": [HAIR], "skeleton": "/Hero/Rig"}]
)
def test_who_names_hair_or_skeleton_gets_the_same_person(tmp_path, named):
    path = _apart(tmp_path)
    every, some = (read_shot(path, **options).grooms[0] for options in ({}, named))
    body, other = (each.attachment.character.body for each in (every, some))
    assert other is not None and np.array_equal(body.points, other.points)


def test_a_body_is_measured_with_what_all_skeletons_skin(tmp_path):
    """The skeleton that carries the hair skins only the neck, so that the top of its head would lie below its joint."""
    path = _apart(tmp_path)
    layer = Sdf.Layer.FindOrOpen(str(path))
    Sdf.CopySpec(layer, "/Coat/Skin", layer, "/Hero/Skin")
    stage = Usd.Stage.Open(layer)
    skin = UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin"))
    for relation in skin.GetPrim().GetRelationships():
        relation.SetTargets([each.ReplacePrefix("/Coat", "/Hero") for each in relation.GetTargets()])
    points = np.array(skin.GetPointsAttr().Get())
    corners = np.array(skin.GetFaceVertexIndicesAttr().Get()).reshape(-1, skin.GetFaceVertexCountsAttr().Get()[0])
    low = points[corners][..., 1].max(axis=1) < np.median(points[:, 1])
    points[np.setdiff1d(np.arange(len(points)), corners[low])] = points[corners[low][0, 0]]  # a split drops these
    skin.GetPointsAttr().Set(points)
    skin.GetFaceVertexIndicesAttr().Set(corners[low].ravel().tolist())
    skin.GetFaceVertexCountsAttr().Set([corners.shape[1]] * int(low.sum()))
    layer.Save()
    whole = write_shot(tmp_path, Recipe(), "whole")
    for notes in (lambda shot: read_shot(shot).notes, lambda shot: inspect(shot)["spoils"]):
        wanted, found = ([note for note in notes(shot) if "(trained: " in note] for shot in (whole, path))
        assert found == wanted


def test_a_character_elsewhere_is_another_one(tmp_path):
    path = _apart(tmp_path)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Xformable(stage.GetPrimAtPath("/Coat")).AddTranslateOp().Set((1, 0, 0))
    stage.Save()
    (groom,) = read_shot(path).grooms
    assert groom.path == HAIR and groom.attachment.character.body is None


def test_meshes_on_joints_of_other_names_are_told(tmp_path):
    """Names that say which joint it is, but not the same."""
    path = _apart(tmp_path, rename=lambda name: "/".join(f"{part}_x" for part in name.split("/")))
    told = "/Hero/Rig: /Coat/Rig is the same character, but no joint there moves like one of the same name here"
    assert any(note.startswith(told) for note in read_shot(path).notes)
    assert any(note.startswith(told) for note in inspect(path)["spoils"])
    assert not any("no body" in note for note in read_shot(path).notes)


def test_of_many_skeletons_of_a_character_it_is_told_how_many_there_are():
    for count, who in ((4, "/Part3 are"), (9, "6 more skeletons are")):
        (note,) = partial_body(SimpleNamespace(path="/Hero"), [f"/Part{number}" for number in range(count)])
        assert note.startswith(f"/Hero: /Part0, /Part1, /Part2, {who} the same character"), note
