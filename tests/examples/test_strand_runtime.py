# SPDX-License-Identifier: Apache-2.0
"""What is exported, and what is said about it, is enough to have a bake's hair without this program."""

import json

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from examples.strand_runtime import differences
from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.models import model_file
from tests.strand_models import write_random_model
from tests.usd.shots import HEAD, JOINTS, Recipe, strand_points, write_shot
from usd.baking.bake import bake
from usd.models.export import export_model


@pytest.fixture
def shot(tmp_path):
    """A turned and moved character with straight hair of 24 vertices."""
    turned = np.array([[0.0, 0, 1, 3], [0, 1, 0, 0.5], [-1, 0, 0, -2], [0, 0, 0, 1]])
    path = write_shot(tmp_path, Recipe(frames=40, vertices=2, strands=60, place=turned))
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    ends = strand_points(60, 2)
    points = ends[:, :1] + np.linspace(0, 1, 24)[None, :, None] * np.diff(ends, axis=1)
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    curves.GetCurveVertexCountsAttr().Set([24] * 60)
    stage.Save()
    return path


def test_a_runtime_written_from_the_description_has_the_hair_of_the_bake(tmp_path, shot):
    model = model_file.shipped("strands")
    files = export_model(model, tmp_path / "onnx", shot)
    assert {path.name for path in files} >= {"description.json", "tail.onnx", "Hero_Hair.npz"}
    for number, material in enumerate(({}, {"bend": 4e-4, "damping": 6.0}, {"weight": 1.4, "clumping": 5.0})):
        baked = tmp_path / f"{number}.usdc"
        bake(shot, baked, model, frames="1:40:13", resolve=False, material=material)
        assert differences(tmp_path / "onnx", shot, baked, material).max() < 1e-5
        if material:
            assert differences(tmp_path / "onnx", shot, baked, {}).max() > 1e-4


def test_on_hair_that_is_not_even_in_arc_length_the_median_tells_whether_the_runtime_is_right(tmp_path, shot):
    stage = Usd.Stage.Open(str(shot))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    ends = strand_points(60, 2)
    points = ends[:, :1] + np.linspace(0, 1, 17)[None, :, None] ** 1.5 * np.diff(ends, axis=1)
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    curves.GetCurveVertexCountsAttr().Set([17] * 60)
    stage.Save()
    model = model_file.shipped("strands")
    export_model(model, tmp_path / "onnx", shot)
    bake(shot, tmp_path / "hair.usdc", model, frames="1:40:13", resolve=False, material={"bend": 4e-4})
    right, wrong = (differences(tmp_path / "onnx", shot, tmp_path / "hair.usdc", m) for m in ({"bend": 4e-4}, {}))
    assert np.median(right) < 2e-4 < np.median(wrong)
    assert right.max() < 5e-3


PAPER = BoundarySpec(bins=(1,) * 30, linear="none", taper=0.0)


@pytest.mark.parametrize(
    ("spec", "settings"),
    [
        (BoundarySpec(), {"anchored": False}),
        (PAPER, {"anchored": False, "output": "displacement"}),
        (BoundarySpec(linear="velocity", chest=False), {}),
    ],
    ids=["not anchored", "the paper's", "velocity"],
)
def test_it_has_it_too_of_models_of_other_kinds(tmp_path, shot, spec, settings):
    model = write_random_model(tmp_path / "random.neuralocks", 4.0, spec, **settings)
    export_model(model, tmp_path / "onnx", shot)
    material = {"weight": 1.4, "clumping": 5.0}
    bake(shot, tmp_path / "hair.usdc", model, frames="1:40:13", resolve=False, material=material)
    assert differences(tmp_path / "onnx", shot, tmp_path / "hair.usdc", material).max() < 1e-5


@pytest.mark.parametrize("wider", [2, 6])
def test_it_has_it_too_where_the_shot_is_longer_than_its_animation_and_between_samples(tmp_path, shot, wider):
    """Two frames before the samples do not count as standing still, six do. The groom, too, may have samples alone."""
    stage = Usd.Stage.Open(str(shot))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    for each in (curves.GetPointsAttr(), curves.GetCurveVertexCountsAttr()):
        modelled = each.Get()
        each.Clear()
        each.Set(modelled, 1)
    stage.SetStartTimeCode(1 - wider)
    stage.SetEndTimeCode(40 + wider)
    stage.Save()
    model = model_file.shipped("strands")
    export_model(model, tmp_path / "onnx", shot)
    codes = [1 - wider, 1, 2.5, 5, 38.3, 40, 41, 40 + wider]
    bake(shot, tmp_path / "hair.usdc", model, frames=codes, resolve=False)
    assert differences(tmp_path / "onnx", shot, tmp_path / "hair.usdc", {}).max() < 1e-5


def test_it_has_it_too_on_a_character_that_is_shown_larger_and_whose_head_grows(tmp_path, shot):
    stage = Usd.Stage.Open(str(shot))
    UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddScaleOp().Set(Gf.Vec3f(1.2))
    scales = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion")).GetScalesAttr()
    for code, size in ((1, 1), (20, 1.25), (40, 1.5)):
        scales.Set([Gf.Vec3h(size if joint == HEAD else 1) for joint in range(len(JOINTS))], code)
    stage.Save()
    model = model_file.shipped("strands")
    export_model(model, tmp_path / "onnx", shot)
    bake(shot, tmp_path / "hair.usdc", model, frames="1:40:13", resolve=False)
    assert differences(tmp_path / "onnx", shot, tmp_path / "hair.usdc", {}).max() < 1e-5


def test_it_has_it_too_on_a_body_of_another_shape_than_it_was_groomed_on(tmp_path, shot):
    stage = Usd.Stage.Open(str(shot))
    skin = stage.GetPrimAtPath("/Hero/Skin")
    larger = UsdSkel.BlendShape.Define(stage, "/Hero/Skin/Larger")
    larger.CreateOffsetsAttr([Gf.Vec3f(0, 0.02, 0)] * len(skin.GetAttribute("points").Get()))
    binding = UsdSkel.BindingAPI.Apply(skin)
    binding.CreateBlendShapesAttr(["larger"])
    binding.CreateBlendShapeTargetsRel().SetTargets([larger.GetPath()])
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    animation.CreateBlendShapesAttr(["larger"])
    animation.CreateBlendShapeWeightsAttr([0.5])
    stage.Save()
    model = model_file.shipped("strands")
    export_model(model, tmp_path / "onnx", shot)
    for clumping in (60, 10):
        baked = tmp_path / f"{clumping}.usdc"
        bake(shot, baked, model, frames="1:40:13", resolve=False, material={"clumping": clumping})
        assert differences(tmp_path / "onnx", shot, baked, {"clumping": clumping}).max() < 1e-5


@pytest.mark.parametrize(
    ("recipe", "told"), [(Recipe(unit=0.01), "0.01 m and has Y up"), (Recipe(up="Z"), "1 m and has Z up")]
)
def test_a_stage_of_another_unit_or_axis_is_refused(tmp_path, recipe, told):
    """Its answer would be metres off, and look like a fault of the export."""
    path = write_shot(tmp_path, recipe)
    export_model(model_file.shipped(), tmp_path / "onnx", path)
    with pytest.raises(SystemExit, match=f"counts in {told}"):
        differences(tmp_path / "onnx", path, path, {})


def test_every_array_of_a_groom_is_described(tmp_path, shot):
    export_model(model_file.shipped("strands"), tmp_path, shot)
    described = json.loads((tmp_path / "description.json").read_text())["grooms"]
    with np.load(tmp_path / "Hero_Hair.npz") as arrays:
        assert set(arrays) == set(described["arrays"])
        assert all(f"{arrays[name].dtype}" in text or name == "valid" for name, text in described["arrays"].items())
    facts = described["files"]["Hero_Hair.npz"]
    assert (facts["prim"], facts["strands"]) == ("/Hero/Hair", 60)
    assert facts["joints"].keys() == {"head", "upper chest", "pose"} and len(facts["joints"]["pose"]) == 6
