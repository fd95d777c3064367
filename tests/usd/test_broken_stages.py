# SPDX-License-Identifier: Apache-2.0
"""Stages with something broken, or missing, are named in one line by a bake and by `inspect`; nothing is left behind."""

import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig

from .shots import HAIR, JOINTS, MOTION, RIG, SKIN, Recipe, edited, write_shot


def attribute(path, name, value, time=None):
    """An edit that sets an attribute."""

    def edit(stage):
        target = stage.GetPrimAtPath(path).GetAttribute(name)
        target.Set(value) if time is None else target.Set(value, time)

    return edit


def changed(path, name, change, time=None):
    """An edit that changes the value that an attribute has."""

    def edit(stage):
        target = stage.GetPrimAtPath(path).GetAttribute(name)
        code = Usd.TimeCode.Default() if time is None else Usd.TimeCode(time)
        value = target.Get(code)
        change(value) if not isinstance(value, float) else None
        target.Set(value, code)

    return edit


def scaled_root(*scale):
    def edit(stage):
        UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddScaleOp().Set(Gf.Vec3f(*scale))

    return edit


def unbound(stage):
    stage.GetPrimAtPath(RIG).GetRelationship("skel:animationSource").SetTargets([])


def renamed(stage):
    """No joint's name says head, and nothing binds the groom."""
    names = [f"bone{i}" for i in range(len(JOINTS))]
    paths = [names[0], *(f"{names[0]}/{n}" for n in names[1:])]
    stage.GetPrimAtPath(RIG).GetAttribute("joints").Set(paths)
    stage.GetPrimAtPath(MOTION).GetAttribute("joints").Set(paths)


def with_shape(indices):
    """An edit that gives the skin a blend shape of two offsets, for points of these indices."""

    def edit(stage):
        shape = UsdSkel.BlendShape.Define(stage, f"{SKIN}/smile")
        shape.CreateOffsetsAttr([Gf.Vec3f(0.01)] * 2)
        shape.CreatePointIndicesAttr(indices)
        binding = UsdSkel.BindingAPI(stage.GetPrimAtPath(SKIN))
        binding.CreateBlendShapesAttr(["smile"])
        binding.CreateBlendShapeTargetsRel().SetTargets([shape.GetPath()])

    return edit


def assign(index, value):
    def change(array):
        array[index] = value

    return change


def retyped(path, name, kind):
    """An edit that declares an attribute with another type, as may happen when a schema is misread."""

    def edit(stage):
        layer, target = stage.GetRootLayer(), Sdf.ValueTypeNames.Find(kind)
        spec = layer.GetAttributeAtPath(f"{path}.{name}")
        owner, variability = spec.owner, spec.variability
        owner.RemoveProperty(spec)
        value = [target.scalarType.defaultValue] * 8 if target.isArray else target.defaultValue
        Sdf.AttributeSpec(owner, name, target, variability).default = type(target.defaultValue)(value)

    return edit


NAN = float("nan")


BROKEN = {
    "nan points": (changed(HAIR, "points", assign(7, Gf.Vec3f(NAN, 0, 0))), HAIR, "not finite"),
    "all nan": (attribute(HAIR, "points", Vt.Vec3fArray(480, Gf.Vec3f(NAN))), HAIR, "not finite"),
    "infinite points": (changed(HAIR, "points", assign(8, Gf.Vec3f(float("inf"), 0, 0))), HAIR, "not finite"),
    "ragged counts": (changed(HAIR, "curveVertexCounts", assign(0, 11)), HAIR, "sum to"),
    "negative count": (changed(HAIR, "curveVertexCounts", assign(0, -12)), HAIR, "negative"),
    "no strands": (attribute(HAIR, "curveVertexCounts", []), HAIR, "no strands"),
    "no points": (attribute(HAIR, "points", []), HAIR, "no points"),
    "far points": (changed(HAIR, "points", assign(9, Gf.Vec3f(1e30, 0, 0))), HAIR, "check the unit"),
    "bad joint index": (attribute(HAIR, "primvars:skel:jointIndices", [99]), HAIR, "joint index"),
    "nan weight": (attribute(HAIR, "primvars:skel:jointWeights", [NAN]), HAIR, "weights"),
    "short skin": (attribute(SKIN, "primvars:skel:jointIndices", [0, 1]), SKIN, "joint indices"),
    "nan skin": (changed(SKIN, "points", assign(0, Gf.Vec3f(NAN))), SKIN, "NaN"),
    "bad face": (changed(SKIN, "faceVertexIndices", assign(0, 9999)), SKIN, "face"),
    "few shape offsets": (with_shape([]), f"{SKIN}/smile", "2 offsets for 416 points"),
    "more shape offsets than points": (with_shape([0]), f"{SKIN}/smile", "2 offsets and 1 point indices do not fit"),
    "shape of no point": (with_shape([0, 416]), f"{SKIN}/smile", "do not fit 416 points"),
    "no animation": (unbound, RIG, "no animation"),
    "nan rotation": (changed(MOTION, "rotations", assign(3, Gf.Quatf(NAN)), 4), MOTION, "NaN"),
    "null rotation": (changed(MOTION, "rotations", assign(3, Gf.Quatf(0, 0, 0, 0)), 4), MOTION, "null rotation"),
    "short animation": (attribute(MOTION, "translations", [Gf.Vec3f(0)], 4), MOTION, "for 8 joints"),
    "few binds": (attribute(RIG, "bindTransforms", [Gf.Matrix4d(1)]), RIG, "for 8 joints"),
    "flat bind": (changed(RIG, "bindTransforms", assign(3, Gf.Matrix4d(0))), RIG, "zero scale"),
    "nan bind": (changed(RIG, "bindTransforms", assign(3, Gf.Matrix4d(NAN))), RIG, "NaN"),
    "no joints": (attribute(RIG, "joints", []), RIG, "no joints"),
    "double joint": (attribute(RIG, "joints", ["a"] * 8), RIG, "twice"),
    "joint animated twice": (attribute(MOTION, "joints", ["hips", *["a"] * 7]), MOTION, "'a' is listed twice"),
    "child first": (attribute(RIG, "joints", ["a/b", "a", *"cdefgh"]), RIG, "before its parent"),
    "offsets as joints": (retyped(RIG, "joints", "float3[]"), RIG, "its joints are float3[], not token[]"),
    "number as binds": (retyped(RIG, "bindTransforms", "float"), RIG, "are float, not matrix4d[]"),
    "offsets as binds": (retyped(RIG, "bindTransforms", "float3[]"), RIG, "are float3[], not matrix4d[]"),
    "words as faces": (retyped(SKIN, "faceVertexCounts", "token[]"), SKIN, "are token[], not int[]"),
    "words as corners": (retyped(SKIN, "faceVertexIndices", "token[]"), SKIN, "are token[], not int[]"),
    "number as skin": (retyped(SKIN, "points", "float"), SKIN, "are float, not point3f[]"),
    "words as indices": (retyped(SKIN, "primvars:skel:jointIndices", "token[]"), SKIN, "are token[], not int[]"),
    "number as weights": (retyped(SKIN, "primvars:skel:jointWeights", "double"), SKIN, "are double, not float[]"),
    "number as bind": (retyped(SKIN, "primvars:skel:geomBindTransform", "float"), SKIN, "are float, not matrix4d;"),
    "offsets as counts": (retyped(HAIR, "curveVertexCounts", "float3[]"), HAIR, "are float3[], not int[]"),
    "number as hair": (retyped(HAIR, "points", "float"), HAIR, "are float, not point3f[]"),
    "counts as hair": (retyped(HAIR, "points", "int[]"), HAIR, "are int[], not point3f[]"),
    "turns as hair": (retyped(HAIR, "points", "quath[]"), HAIR, "are quath[], not point3f[]"),
    "matrix as hair": (retyped(HAIR, "points", "matrix4d"), HAIR, "are matrix4d, not point3f[]"),
    "mirrored root": (scaled_root(-1, 1, 1), RIG, "mirrored"),
    "flat root": (scaled_root(1, 0, 1), "/Hero", "zero scale"),
    "nan root": (scaled_root(1, NAN, 1), "/Hero", "NaN"),
    "stray key": (attribute(MOTION, "translations", [Gf.Vec3f(0)] * 8, 1e9), RIG, "stray keys"),
    "no unit": (lambda stage: UsdGeom.SetStageMetersPerUnit(stage, 0), "shot.usda", "metersPerUnit"),
    "no rate": (lambda stage: stage.SetTimeCodesPerSecond(0), "shot.usda", "timeCodesPerSecond"),
    "no groom": (lambda stage: stage.RemovePrim(HAIR), "shot.usda", "no groom"),
    "no skeleton": (lambda stage: stage.RemovePrim(RIG), "shot.usda", "no UsdSkel skeleton"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_stage_is_named_in_one_line(tmp_path, model, case):
    edit, subject, fact = BROKEN[case]
    path = edited(tmp_path, edit)
    with pytest.raises(NeuralocksError) as caught:
        bake(path, tmp_path / "out.usdc", model)
    message = str(caught.value)
    assert subject in message and fact in message and "; " in message and "\n" not in message
    assert [p.name for p in tmp_path.iterdir()] == ["shot.usda"]
    try:
        facts = inspect(path)
    except NeuralocksError as error:
        assert fact in str(error)
    else:
        assert any(fact in line for line in facts["stops"])
        assert len(facts["stops"]) == len(set(facts["stops"])), "each is told once"


def test_a_stage_without_anything_lacks_skeleton_and_groom_whatever_it_is_called(tmp_path):
    Usd.Stage.CreateNew(str(tmp_path / "groom.usda")).Save()
    stops = inspect(tmp_path / "groom.usda")["stops"]
    assert "no UsdSkel skeleton; export the character" in stops[0] and "no BasisCurves prim" in stops[1]


def test_a_groom_alone_is_told_to_be_put_on_its_character(tmp_path, model):
    """As `neuralocks import` writes it; and if a layer is missing, that is named as the cause."""
    shot = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    stage.RemovePrim(RIG)
    stage.Save()
    for missing, remedy in (
        (None, "if it holds hair alone, sublayer or reference it"),
        ("lost.usda", "add or repair the files that it"),
    ):
        if missing:
            Sdf.Layer.FindOrOpen(str(shot)).subLayerPaths.append(missing)
        with pytest.raises(NeuralocksError, match=f"no UsdSkel skeleton; .*{remedy}") as caught:
            bake(shot, tmp_path / "out.usdc", model)
        assert str(caught.value).removeprefix(f"{tmp_path}/") in inspect(shot)["stops"]


def test_where_a_character_stands_that_cannot_be_used_stops_nothing_more(tmp_path):
    """It is ten kilometres out by a transform, where a usable one can be baked."""
    shot = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddTranslateOp().Set((12000, 0, 0))
    stage.GetPrimAtPath("/Hero/Rig").GetAttribute("joints").Set(["rig:hips"])
    stage.Save()
    (stop,) = inspect(shot)["stops"]
    assert "'rig:hips', which is not a path" in stop


def test_a_rig_without_a_head_can_be_helped_by_hand(tmp_path, model):
    path = edited(tmp_path, renamed, Recipe(bound="none"))
    with pytest.raises(NeuralocksError, match="--head"):
        bake(path, tmp_path / "out.usdc", model)
    assert bake(path, tmp_path / "out.usdc", model, head="bone3").grooms[0]["joint"].endswith("bone3")


@pytest.mark.parametrize("damaged", [False, True])
@pytest.mark.parametrize(
    "made_of", ["(\n    subLayers = [@./groom.usda@]\n)", 'def "Hero" (\n    references = @./groom.usda@\n)\n{\n}']
)
def test_a_shot_that_came_without_its_layers_is_told_so(tmp_path, model, made_of, damaged):
    """For a shot copied away from its layers, or with only a part of one, the message must not be that it needs a groom."""
    if damaged:
        (tmp_path / "groom.usda").write_text("#usda 1.0\ndef {")
    path = tmp_path / "shot.usda"
    path.write_text(f"#usda 1.0\n{made_of}\n")
    for work in (lambda: bake(path, tmp_path / "a.usdc", model), lambda: bake_rig(path, tmp_path / "b.usda")):
        with pytest.raises(
            NeuralocksError,
            match=r"shot.usda: holds no .*parts of it are missing or damaged.*groom.usda.*; add or repair",
        ) as caught:
            work()
        assert "\n" not in str(caught.value)


def test_a_shot_that_cannot_be_composed_is_not_told_to_lack_files(tmp_path, model):
    """What it refers to is there, but has no such prim."""
    write_shot(tmp_path, name="hero")
    path = tmp_path / "shot.usda"
    path.write_text('#usda 1.0\ndef "Hero" (\n    references = @./hero.usda@</Heroine>\n)\n{\n}\n')
    with pytest.raises(NeuralocksError, match=r"could not compose all of it \(.*</Heroine>.*\); repair that$"):
        bake(path, tmp_path / "a.usdc", model)
