# SPDX-License-Identifier: Apache-2.0
"""Files and words that make no scene to train on, and which hair of a shot with several characters is whose."""

import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.models.training_scene import training_scene

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
