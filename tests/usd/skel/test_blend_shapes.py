# SPDX-License-Identifier: Apache-2.0
"""Blend shapes with inbetweens, as UsdSkel deforms by them."""

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from usd.shot.stage import read_rigs

from ..shots import Recipe, write_shot

WEIGHTS = (-0.3, 0.0, 0.2, 0.5, 0.7, 1.0, 1.4, 0.3, 0.9)


def _shaped(path):
    """The shot with a jaw that opens along a curve, keyed through all of it, and a brow without inbetweens."""
    stage = Usd.Stage.Open(str(path))
    skin = UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin"))
    rng = np.random.default_rng(0)
    binding = UsdSkel.BindingAPI(skin.GetPrim())
    targets = []
    for name, betweens in (("jaw", {0.5: "half", 0.8: "most"}), ("brow", {})):
        shape = UsdSkel.BlendShape.Define(stage, f"/Hero/Skin/{name}")
        indices = np.sort(rng.choice(len(skin.GetPointsAttr().Get()), 30, replace=False))
        shape.CreatePointIndicesAttr(Vt.IntArray(indices.tolist()))
        shape.CreateOffsetsAttr(Vt.Vec3fArray.FromNumpy(rng.normal(0, 0.02, (30, 3)).astype(np.float32)))
        for weight, between in betweens.items():
            made = shape.CreateInbetween(between)
            made.SetWeight(weight)
            made.SetOffsets(Vt.Vec3fArray.FromNumpy(rng.normal(0, 0.02, (30, 3)).astype(np.float32)))
        targets.append(shape.GetPath())
    binding.CreateBlendShapesAttr(["jaw", "brow"])
    binding.CreateBlendShapeTargetsRel().SetTargets(targets)
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    motion.CreateBlendShapesAttr(["brow", "jaw"])
    for frame, weight in enumerate(WEIGHTS, start=1):
        motion.CreateBlendShapeWeightsAttr().Set([0.25, weight], frame)
    stage.GetRootLayer().Save()
    return stage, skin, binding


def test_shapes_between_rest_and_full_weight_are_those_of_usd_skel(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh", frames=len(WEIGHTS)))
    stage, skin, binding = _shaped(path)
    rig = read_rigs(path)[0]
    query = UsdSkel.BlendShapeQuery(binding)
    offsets, indices = query.ComputeSubShapePointOffsets(), query.ComputeBlendShapePointIndices()
    for row, weight in enumerate(WEIGHTS):
        points = skin.GetPointsAttr().Get()
        query.ComputeDeformedPoints(*query.ComputeSubShapeWeights([weight, 0.25]), indices, offsets, points)
        assert np.abs(rig.character.body.shaped(rig.clip.shape[row]) - np.asarray(points)).max() < 1e-6


def test_an_inbetween_without_a_weight_is_said(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh", frames=len(WEIGHTS)))
    stage, *_ = _shaped(path)
    spec = stage.GetRootLayer().GetAttributeAtPath(Sdf.Path("/Hero/Skin/jaw.inbetweens:half"))
    spec.ClearInfo("weight")
    stage.GetRootLayer().Save()
    rig = read_rigs(path)[0]
    assert any("inbetweens:half" in note for note in rig.notes)
    assert list(rig.character.body.shapes) == ["jaw at 0.8", "jaw", "brow"]
