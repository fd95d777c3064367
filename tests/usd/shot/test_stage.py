# SPDX-License-Identifier: Apache-2.0
"""Reading stages: poses as UsdSkel evaluates them, skin as UsdSkel deforms it, joints as they are meant."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.strands.arclength import resample
from usd.border.units import Border
from usd.review.groom_facts import groom_facts
from usd.review.inspect import inspect
from usd.shot.notes.groom_notes import groom_notes
from usd.shot.stage import read_rigs, read_shot

from ..shots import HEAD, POSITIONS, Recipe, write_shot

BODY = Path(__file__).parents[3] / "examples" / "shot" / "shot.usda"


@pytest.mark.parametrize("recipe", [Recipe(), Recipe(unit=0.01, up="Z")], ids=["m", "cm_z_up"])
def test_poses_are_those_of_usd_skel(tmp_path, recipe):
    shot = read_shot(write_shot(tmp_path, recipe))
    rig, cache = shot.rigs[0], UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(shot.stage.GetPrimAtPath("/Hero")), Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(shot.stage.GetPrimAtPath("/Hero/Rig")))
    for code in (1.0, 3.5, 9.0, 20.0):
        theirs = np.array(query.ComputeJointSkelTransforms(code)).swapaxes(-1, -2)
        assert np.abs(rig.joints.posed([code])[0] - theirs).max() < 1e-5
    at_frame = rig.clip.at([shot.border.seconds(4.0)])[0]
    assert np.abs(rig.joints_at(4.0) - at_frame).max() < 1e-9


def test_bind_pose_comes_in_metres_y_up_whatever_the_stage(tmp_path):
    for i, recipe in enumerate([Recipe(), Recipe(unit=0.01), Recipe(unit=0.0254, up="Z", nesting="/A/B/C")]):
        rig = read_shot(write_shot(tmp_path, recipe, f"s{i}")).rigs[0]
        assert np.abs(rig.character.skeleton.bind[:, :3, 3] - POSITIONS).max() < 1e-6
        assert rig.character.head == HEAD
        assert np.allclose(rig.character.facing, np.eye(3))
        width = np.ptp(rig.character.body.points[rig.character.head_skin][:, 0])
        assert abs(width - 0.2) < 1e-3
        inward = np.cross(
            *np.diff(rig.character.body.points[rig.character.body.triangles[:150]], axis=1).swapaxes(0, 1)
        )
        centre = rig.character.body.points[rig.character.body.triangles[:150]].mean(1) - [0, 1.68, 0.02]
        assert ((inward * centre).sum(1) > -1e-12).all()


@pytest.mark.skipif(not BODY.exists(), reason="examples/shot is not in this checkout")
def test_the_shipped_body_is_posed_as_usd_skel_deforms_it():
    shot = read_shot(BODY)
    rig = shot.rigs[0]
    root = UsdSkel.Root(shot.stage.GetPrimAtPath("/Body"))
    cache = UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(shot.stage.GetPrimAtPath(rig.path)))
    mesh = shot.stage.GetPrimAtPath("/Body/Skin")
    code = 60.0
    points = Vt.Vec3fArray(UsdGeom.Mesh(mesh).GetPointsAttr().Get())
    assert not rig.clip.shape.any(), "UsdSkel poses the points without blend shapes here"
    assert cache.GetSkinningQuery(mesh).ComputeSkinnedPoints(query.ComputeSkinningTransforms(code), points, code)
    posed = rig.character.posed_body(rig.joints_at(code))
    assert np.abs(posed - np.asarray(points)).max() < 1e-4


def test_rigs_are_read_without_grooms_or_animation(tmp_path):
    path = write_shot(tmp_path, Recipe(frames=0))
    assert len(read_rigs(path)[0].clip.times) == 1
    with pytest.raises(NeuralocksError, match="no animation"):
        read_shot(path)
    facts = inspect(path)
    assert any("no animation" in text for text in facts["stops"])
    assert not any("one sample" in text for text in facts["spoils"])


def test_why_an_animation_does_not_count_is_what_is_wrong_with_it(tmp_path):
    """And not an error of a mesh, which has its own message later."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath("/Hero/Rig/Motion").GetAttribute("scales").Clear()
    mesh = UsdSkel.BindingAPI.Apply(UsdGeom.Mesh.Define(stage, "/Hero/Empty").GetPrim())
    mesh.CreateSkeletonRel().SetTargets(["/Hero/Rig"])
    mesh.CreateJointIndicesPrimvar(True, 1).Set([3])
    mesh.CreateJointWeightsPrimvar(True, 1).Set([1.0])
    stage.GetRootLayer().Save()
    with pytest.raises(
        NeuralocksError, match=r"no animation \(no scales, so UsdSkel ignores the animation\)"
    ) as raised:
        read_shot(path)
    assert str(raised.value) in inspect(path)["stops"]


@pytest.mark.parametrize("bound", ["own", "mesh"])
def test_values_at_a_single_time_are_values_at_rest(tmp_path, bound):
    """Exporters of single frames write everything that may vary as one sample, including transforms and weights."""
    place = np.eye(4)
    place[:3, 3] = 3, 0, 1
    path = write_shot(tmp_path, Recipe(bound=bound, place=place, unit=0.01))
    right = read_shot(path)
    layer = Sdf.Layer.FindOrOpen(str(path))

    def sampled(path):
        spec = layer.GetAttributeAtPath(path) if path.IsPropertyPath() else None
        if spec and spec.HasDefaultValue() and spec.variability != Sdf.VariabilityUniform:
            value = spec.default
            spec.ClearDefaultValue()
            layer.SetTimeSample(path, 1.0, value)

    layer.Traverse("/", sampled)
    other = tmp_path / "sampled.usda"
    layer.Export(str(other))
    read = read_shot(other)
    assert read.grooms[0].joint == right.grooms[0].joint
    np.testing.assert_array_equal(read.grooms[0].groom.points, right.grooms[0].groom.points)
    np.testing.assert_array_equal(read.grooms[0].placement.at(5), right.grooms[0].placement.at(5))
    np.testing.assert_array_equal(read.rigs[0].character.body.points, right.rigs[0].character.body.points)
    np.testing.assert_array_equal(read.rigs[0].character.body.joint_indices, right.rigs[0].character.body.joint_indices)


@given(st.floats(1e-4, 1e3), st.sampled_from(["Y", "Z"]), st.floats(1, 240))
@settings(max_examples=30, deadline=None)
def test_crossing_the_border_and_back_changes_nothing(unit, up, rate):
    border = Border(unit, up, rate)
    points = np.array([[1.0, 2, 3], [-4, 5, 0.5]])
    there = points @ border.to_core[:3, :3].T
    assert np.allclose(there @ border.from_core[:3, :3].T, points)
    assert np.allclose(np.linalg.norm(there, axis=1), unit * np.linalg.norm(points, axis=1))
    assert np.allclose(border.to_core[:3, :3] @ ([0, 1, 0] if up == "Y" else [0, 0, 1]), [0, unit, 0])


def test_joints_named_by_hand_serve_and_missing_ones_are_said(tmp_path):
    path = write_shot(tmp_path)
    plain = read_shot(path)
    assert any("left_shoulder" in note and "--joint" in note for note in plain.notes)
    told = read_shot(path, joints={"left_shoulder": "arm_L", "right_shoulder": "hips/spine/arm_R"})
    assert told.rigs[0].character.humanoid["left_shoulder"] == 4
    for joints, fact in (({"left_shoulder": "nose"}, "nose"), ({"tail": "hips"}, "tail")):
        with pytest.raises(NeuralocksError, match=fact):
            read_shot(path, joints=joints)


def test_layers_of_another_axis_below_a_bare_first_layer_are_said(tmp_path):
    write_shot(tmp_path, Recipe(unit=0.01, up="Z"))
    first = Sdf.Layer.CreateNew(str(tmp_path / "first.usda"))
    first.subLayerPaths.append("./shot.usda")
    first.Save()
    expected = "first.usda: its layer shot.usda has Z up, the stage Y: the first layer's count; author them there"
    assert expected in read_shot(tmp_path / "first.usda").notes
    assert expected in inspect(tmp_path / "first.usda")["spoils"]


def test_curves_of_another_kind_are_told_to_become_basis_curves(tmp_path):
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    stage.RemovePrim("/Hero/Hair")
    UsdGeom.NurbsCurves.Define(stage, "/Hero/Locks")
    stage.Save()
    with pytest.raises(NeuralocksError, match="no groom .* convert the NurbsCurves /Hero/Locks"):
        read_shot(path)
    assert any("/Hero/Locks" in line for line in inspect(path)["stops"])


def test_a_groom_in_a_variant_that_is_not_chosen_is_named(tmp_path):
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    style = stage.GetPrimAtPath("/Hero").GetVariantSets().AddVariantSet("hair")
    for name in ("long", "none"):
        style.AddVariant(name)
        style.SetVariantSelection(name)
        with style.GetVariantEditContext():
            stage.OverridePrim("/Hero/Hair").SetActive(name == "long")
    stage.GetRootLayer().subLayerPaths.append("gone.usda")
    UsdGeom.NurbsCurves.Define(stage, "/Hero/Control")
    stage.Save()
    with pytest.raises(NeuralocksError, match="choose variant 'long' of 'hair' on /Hero, which has /Hero/Hair"):
        read_shot(path)
    assert any("variant 'long'" in line for line in inspect(path)["stops"])


@pytest.mark.parametrize("prim", ["/Hero/Hair", "/Hero/Rig"])
def test_what_is_switched_off_is_named(tmp_path, prim):
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath(prim).SetActive(False)
    stage.Save()
    with pytest.raises(NeuralocksError, match=f"holds no .*; {prim} is inactive: activate it"):
        read_shot(path)
    assert any("is inactive" in line for line in inspect(path)["stops"])
    stage.GetPrimAtPath(prim).SetActive(True)
    stage.GetPrimAtPath("/Hero").SetSpecifier(Sdf.SpecifierClass)
    stage.GetRootLayer().subLayerPaths.append("gone.usda")  # which is less likely to hold it
    stage.Save()
    with pytest.raises(
        NeuralocksError, match="holds no groom .*; /Hero/Hair is part of a class: let a prim inherit that"
    ):
        read_shot(path)


def test_strands_too_short_to_move_are_counted_alike_everywhere():
    step = np.array([0.05, 0.05, 5e-6, 0.0])[:, None] * [0, -1, 0]
    points = np.array([0, 1.7, 0.1]) + np.arange(3)[None, :, None] * step[:, None]
    groom = Groom("hair", points.reshape(-1, 3).astype(np.float32), np.full(4, 3, np.int32))
    assert (~resample(groom, 24)[1]).sum() == groom_facts(groom)["without two distinct points"] == 2
    stage = Usd.Stage.CreateInMemory()
    (said,) = groom_notes(UsdGeom.BasisCurves.Define(stage, "/Hair").GetPrim(), groom, Border.of(stage))
    assert said == "/Hair: 2 of 4 strands have no two distinct points; they follow the head rigidly"
    dots = Groom("hair", points[:, 0].astype(np.float32), np.ones(4, np.int32))
    (said,) = groom_notes(UsdGeom.BasisCurves.Define(stage, "/Dots").GetPrim(), dots, Border.of(stage))
    assert said == "/Dots: 4 of 4 strands have no two distinct points; they follow the head rigidly"


def test_why_a_skeleton_is_left_out_is_told_whoever_comes_first(tmp_path):
    """Also if the first character of the stage carries no hair, so that no other message mentions it."""
    path = write_shot(tmp_path, Recipe(nesting="/Dog"))
    layer = Sdf.Layer.FindOrOpen(str(path))
    for name in ("Hero", "Villain"):
        other = Sdf.Layer.FindOrOpen(str(write_shot(tmp_path, Recipe(nesting=f"/{name}"), name)))
        Sdf.CopySpec(other, f"/{name}", layer, f"/{name}")
    for name in ("Dog", "Villain"):
        del layer.GetPrimAtPath(f"/{name}").nameChildren["Hair"]
    layer.GetAttributeAtPath("/Villain/Rig.bindTransforms").default = Vt.Matrix4dArray(2)
    layer.Save()
    said = [note for note in read_shot(path).notes if note.startswith("/Villain/Rig")]
    assert len(said) == 1 and said[0].endswith("(this skeleton is left out)")
    assert said == [note for note in inspect(path)["spoils"] if note.startswith("/Villain/Rig")]
    assert said[0] in read_rigs(path)[0].notes
