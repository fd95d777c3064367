# SPDX-License-Identifier: Apache-2.0
"""Files and words that make no scene to train on, and which hair of a shot with several characters is whose."""

from types import SimpleNamespace

import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.hairstyles import STYLES
from usd.models.training_scene import MOST_STRANDS, training_scene

from ..shots import HAIR, Recipe, edited, write_shot


def _bald(stage):
    stage.RemovePrim(HAIR)


def _pointlike(stage):
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath(HAIR)).GetPointsAttr()
    points.Set([points.Get()[0]] * len(points.Get()))


@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        (_bald, {}, "shot.usda: holds no groom .no BasisCurves prim.; give a groom, or 'library'"),
        (_pointlike, {}, "shot.usda: no strand has two distinct points"),
        (_bald, {"variations": 51, "grooms": ["bob"]}, "--variations 51: must be from 0 to 50"),
        (_bald, {"variations": 1}, "--variations 1: apply to the library's styles; add --groom library"),
    ],
)
def test_what_makes_no_scene_is_told_in_a_line(tmp_path, change, options, words):
    with pytest.raises(NeuralocksError, match=words):
        training_scene(edited(tmp_path, change, Recipe(bound="mesh")), **options)


def test_hair_is_of_the_skeleton_that_it_names(tmp_path):
    """Wherever it lies: a binding says more than the nearest head."""
    layer = Sdf.Layer.FindOrOpen(str(write_shot(tmp_path, Recipe())))
    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name, x in (("Anna", -1.0), ("Bert", 1.0)):
        prim = stage.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference(layer.identifier, "/Hero")
        UsdGeom.XformCommonAPI(prim).SetTranslate((x, 0, 0))
    Sdf.CopySpec(layer, HAIR, stage.GetRootLayer(), "/Anna/Bun")
    bun = UsdSkel.BindingAPI(stage.GetPrimAtPath("/Anna/Bun")).GetSkeletonRel()
    for skeleton, count in (("/Anna/Rig", 2), ("/Bert/Rig", 1)):
        bun.SetTargets([skeleton])
        stage.Save()
        told = []
        assert len(training_scene(stage.GetRootLayer().realPath, tell=told.extend).grooms) == count
        assert any("/Anna/Bun: is hair of /Bert/Rig, not of /Anna/Rig; left out" in note for note in told) == (
            count == 1
        )


@pytest.mark.parametrize(
    ("grooms", "styles"), [(["library"], [*STYLES]), ([[*STYLES][2], [*STYLES][1]], [*STYLES][1:3])]
)
def test_styles_of_the_library_are_grown_alike_alone_and_among_all(tmp_path, monkeypatch, grooms, styles):
    """And all else that is asked for is in the scene."""
    shot, said = write_shot(tmp_path, Recipe(bound="mesh")), []
    monkeypatch.setattr("usd.models.training_scene.Barber", lambda character: SimpleNamespace(grow=lambda *how: how))
    monkeypatch.setattr("usd.models.training_scene._strands", lambda how, character: how)
    asked = {"seed": 5, "gestures": {"bow": 2.0}, "frames": 40}
    scene = training_scene(shot, grooms, variations=1, progress=lambda *words: said.append(words), **asked)
    places = [*STYLES]
    wanted = [(style, MOST_STRANDS, 5 + places.index(style), again) for again in (0, 1) for style in styles]
    assert list(scene.grooms) == wanted
    assert said == [(done, len(wanted), f"growing {how[0]}") for done, how in enumerate(wanted)]
    assert {name: getattr(scene, name) for name in asked} == asked
    for most in (0, 50):
        assert len(training_scene(shot, grooms, variations=most).grooms) == len(styles) * (1 + most)


def test_motion_that_is_long_enough_is_not_told(tmp_path, monkeypatch):
    shot = write_shot(tmp_path, Recipe(bound="mesh"))
    for least, short in ((0.6, True), (0.05, False)):
        told = []
        monkeypatch.setattr("neuralocks_core.training.data.rollouts.LEAST", least)
        training_scene(shot, motion=[shot], tell=told.extend)
        assert any("too short to learn from" in note for note in told) == short


def test_what_is_no_hair_beside_hair_is_not_learned_from(tmp_path):
    """Grass of the set, far from the head, and strands that are points."""
    shot = write_shot(tmp_path, Recipe(bound="none"))
    stage = Usd.Stage.Open(str(shot))
    layer = stage.GetRootLayer()
    for name in ("Grass", "Dots"):
        Sdf.CopySpec(layer, HAIR, layer, f"/Hero/{name}")
        points = UsdGeom.BasisCurves(stage.GetPrimAtPath(f"/Hero/{name}")).GetPointsAttr()
        at = points.Get()
        points.Set([at[0]] * len(at) if name == "Dots" else [(x, y - 9, z) for x, y, z in at])
    layer.Save()
    told = []
    assert len(training_scene(shot, tell=told.extend).grooms) == 1
    assert not any("lies" in note for note in told)


def test_hair_on_another_skeleton_of_the_same_person_is_their_own(tmp_path):
    """As where a head and a body have one each."""
    shot = write_shot(tmp_path, Recipe(bound="mesh"))
    layer = Sdf.Layer.FindOrOpen(str(shot))
    Sdf.CopySpec(layer, "/Hero", layer, "/Coat")
    stage = Usd.Stage.Open(layer)
    stage.RemovePrim(HAIR)
    for prim in Usd.PrimRange(stage.GetPrimAtPath("/Coat")):
        for relation in prim.GetRelationships():
            relation.SetTargets([each.ReplacePrefix("/Hero", "/Coat") for each in relation.GetTargets()])
    UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath("/Coat/Hair")).CreateSkeletonRel().SetTargets(["/Coat/Rig"])
    layer.Save()
    for skeleton in ("/Hero/Rig", "/Coat/Rig"):
        assert len(training_scene(shot, skeleton=skeleton).grooms) == 1
    UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/Coat")).SetTranslate((1, 0, 0))
    layer.Save()
    with pytest.raises(NeuralocksError, match="/Coat/Hair: is hair of /Coat/Rig, not of /Hero/Rig; choose its"):
        training_scene(shot, skeleton="/Hero/Rig")
