# SPDX-License-Identifier: Apache-2.0
"""Reading stages: poses as UsdSkel evaluates them, skin as UsdSkel deforms it, and which joint carries what."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip
from usd.border import Border
from usd.inspect import inspect
from usd.stage import read_rigs, read_shot

from .shots import HEAD, POSITIONS, Recipe, strand_points, write_shot

BODY = Path(__file__).parents[2] / "examples" / "shot" / "shot.usda"


@pytest.mark.parametrize("recipe", [Recipe(), Recipe(unit=0.01, up="Z")], ids=["m", "cm_z_up"])
def test_poses_are_those_of_usd_skel(tmp_path, recipe):
    shot = read_shot(write_shot(tmp_path, recipe))
    rig, cache = shot.rigs[0], UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(shot.stage.GetPrimAtPath("/Hero")), Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(shot.stage.GetPrimAtPath("/Hero/Rig")))
    for code in (1.0, 3.5, 9.0, 20.0):
        theirs = np.array(query.ComputeJointSkelTransforms(code)).swapaxes(-1, -2)
        assert np.abs(rig.source.posed([code])[0] - theirs).max() < 1e-5
    at_frame = rig.clip.at([shot.border.seconds(4.0)])[0]
    assert np.abs(rig.joints_at(4.0) - at_frame).max() < 1e-9


def test_bind_pose_comes_in_metres_y_up_whatever_the_stage(tmp_path):
    for i, recipe in enumerate([Recipe(), Recipe(unit=0.01), Recipe(unit=0.0254, up="Z", nesting="/A/B/C")]):
        rig = read_shot(write_shot(tmp_path, recipe, f"s{i}")).rigs[0]
        assert np.abs(rig.character.skeleton.bind[:, :3, 3] - POSITIONS).max() < 1e-6
        assert rig.character.head == HEAD
        assert np.allclose(rig.character.facing, np.eye(3))
        width = np.ptp(rig.character.body.points[rig.character.head_mask()][:, 0])
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
    if not rig.clip.shape.any():
        assert cache.GetSkinningQuery(mesh).ComputeSkinnedPoints(query.ComputeSkinningTransforms(code), points, code)
        posed = rig.character.posed_body(rig.joints_at(code))
        assert np.abs(posed - np.asarray(points)).max() < 1e-4


@pytest.mark.parametrize(
    ("bound", "words"), [("own", "own skel binding"), ("mesh", "on which it sits"), ("none", "name")]
)
def test_what_carries_the_groom_is_said(tmp_path, bound, words):
    shot = read_shot(write_shot(tmp_path, Recipe(bound=bound)))
    assert shot.grooms[0].joint == "hips/spine/neck/head"
    assert words in shot.grooms[0].attachment.how
    assert np.abs(shot.grooms[0].groom.points.reshape(40, 12, 3) - strand_points(40, 12)).max() < 1e-6


def test_a_head_by_hand_serves_where_no_binding_speaks(tmp_path):
    free = read_shot(write_shot(tmp_path, Recipe(bound="none"), "free"), head="neck")
    assert free.grooms[0].joint == "hips/spine/neck"
    bound = read_shot(write_shot(tmp_path, Recipe(), "bound"), head="neck")
    assert bound.grooms[0].joint == "hips/spine/neck/head"
    assert any("--head neck is not used" in note for note in bound.notes)


def test_each_groom_finds_its_own_character(tmp_path):
    write_shot(tmp_path, Recipe(bound="mesh"), "asset")
    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, "Y")
    for name, x in (("A", 0.0), ("B", 2.0)):
        prim = UsdGeom.Xform.Define(stage, f"/{name}")
        prim.AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        model = stage.DefinePrim(f"/{name}/Model")
        model.GetReferences().AddReference("./asset.usda")
    stage.GetRootLayer().Save()
    shot = read_shot(tmp_path / "two.usda")
    assert [(g.path, g.attachment.rig.path) for g in shot.grooms] == [
        ("/A/Model/Hair", "/A/Model/Rig"),
        ("/B/Model/Hair", "/B/Model/Rig"),
    ]
    only = read_shot(tmp_path / "two.usda", skeleton="/B/Model/Rig", grooms=["/B"])
    assert [g.path for g in only.grooms] == ["/B/Model/Hair"]


@pytest.mark.parametrize("bound", ["own", "mesh", "none"])
@pytest.mark.parametrize("places", [(2.0, 0.0), (0.0, 0.0)])
def test_hair_at_the_origin_is_not_another_characters(tmp_path, bound, places):
    """Hair lies there as any character's does in its bind pose."""
    write_shot(tmp_path, Recipe(bound=bound), "asset")
    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name, x in zip("AB", places, strict=True):
        UsdGeom.Xform.Define(stage, f"/{name}").AddTranslateOp().Set(Gf.Vec3d(x, 0, 0))
        stage.DefinePrim(f"/{name}/Model").GetReferences().AddReference("./asset.usda")
    stage.GetRootLayer().Save()
    for chosen in (None, "/A/Model/Rig", "/B/Model/Rig"):
        shot = read_shot(tmp_path / "two.usda", skeleton=chosen)
        pairs = [(item.path[:2], item.attachment.rig.path[:2]) for item in shot.grooms]
        assert pairs == [(name, name) for name in ("/A", "/B") if chosen is None or chosen.startswith(name)]


def _curves(stage, path, points):
    """Curves (n, 2, 3) [m] without a binding."""
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr("linear")
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    curves.CreateCurveVertexCountsAttr([2] * len(points))


def test_curves_out_of_every_heads_reach_are_no_hair_unless_they_are_named(tmp_path):
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="mesh"))))
    roots = np.random.default_rng(0).uniform(-4, 4, (50, 1, 3)) * [1, 0, 1] + [6, 0, 0]
    _curves(stage, "/Set/Grass", np.concatenate([roots, roots + [0, 0.2, 0]], axis=1))
    stage.GetRootLayer().Save()
    path = stage.GetRootLayer().realPath
    shot = read_shot(path)
    assert [item.path for item in shot.grooms] == ["/Hero/Hair"]
    assert sum("/Set/Grass" in note and "--groom" in note for note in shot.notes) == 1
    facts = inspect(path)
    assert [groom["path"] for groom in facts["grooms"]] == ["/Hero/Hair"] and not facts["stops"]
    assert sum("/Set/Grass" in note for note in facts["spoils"]) == 1
    assert [item.path for item in read_shot(path, ["/Set"]).grooms] == ["/Set/Grass"]
    for number in range(30):
        Sdf.CopySpec(stage.GetRootLayer(), "/Set/Grass", stage.GetRootLayer(), f"/Set/Grass{number}")
    stage.GetRootLayer().Save()
    assert len([note for note in read_shot(path).notes if "Grass" in note or "28 more" in note]) == 4
    stage.RemovePrim("/Set")
    Sdf.CreatePrimInLayer(stage.GetRootLayer(), "/Set")
    _curves(stage, "/Set/Grass", np.concatenate([roots, roots + [0, 0.2, 0]], axis=1))
    stage.RemovePrim("/Hero/Hair")
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match="/Set/Grass.*not taken for hair"):
        read_shot(path)
    assert len(inspect(path)["stops"]) == 1


def test_empty_curves_stop_nothing_beside_a_groom(tmp_path):
    stage = Usd.Stage.Open(str(write_shot(tmp_path)))
    UsdGeom.BasisCurves.Define(stage, "/Hero/Empty")
    stage.GetRootLayer().Save()
    path = stage.GetRootLayer().realPath
    shot, facts = read_shot(path), inspect(path)
    assert [item.path for item in shot.grooms] == ["/Hero/Hair"] == [groom["path"] for groom in facts["grooms"]]
    assert any("/Hero/Empty" in note for note in shot.notes) and any("/Hero/Empty" in note for note in facts["spoils"])
    with pytest.raises(NeuralocksError, match="no points"):
        read_shot(path, ["/Hero/Empty"])


def test_a_character_that_stands_still_stops_nothing_beside_one_that_moves(tmp_path):
    for name, frames in (("hero", 9), ("doll", 0)):
        write_shot(tmp_path, Recipe(frames=frames), name)
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name in ("hero", "doll"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(f"./{name}.usda", "/Hero")
    stage.GetRootLayer().Save()
    shot = read_shot(tmp_path / "shot.usda")
    assert [item.path for item in shot.grooms] == ["/hero/Hair"]
    assert any("/doll/Hair" in note and "no animation" in note for note in shot.notes)
    with pytest.raises(NeuralocksError, match="/doll/Rig.*no animation"):
        read_shot(tmp_path / "shot.usda", ["/doll/Hair"])


def test_fur_that_one_joint_cannot_carry_is_said(tmp_path):
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="mesh"))))
    skin = np.array(UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin")).GetPointsAttr().Get())
    _curves(stage, "/Hero/Fur", np.stack([skin, skin + [0, 0.02, 0]], axis=1))
    stage.GetRootLayer().Save()
    notes = read_shot(stage.GetRootLayer().realPath).notes
    assert sum("will leave the skin" in note for note in notes) == 1
    assert any(note.startswith("/Hero/Fur: only 50%") and "(head)" in note for note in notes)


def test_hair_moved_by_its_own_parents_lies_where_it_began(tmp_path):
    """As exported by tools that bake a head constraint into the groom's transform."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    rig = read_shot(path).rigs[0]
    stage = Usd.Stage.Open(str(path))
    op = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero/Hair")).AddTransformOp()
    for frame in range(1, 10):
        op.Set(Gf.Matrix4d(rig.character.carrying(rig.joints_at(frame)).T.tolist()), frame)
    stage.GetRootLayer().Save()
    item = read_shot(path).grooms[0]
    assert item.joint.endswith("head")
    assert np.abs(item.groom.points.reshape(40, 12, 3) - strand_points(40, 12)).max() < 1e-5


def test_a_rate_of_its_own_gives_seconds_of_its_own(tmp_path):
    shot = read_shot(write_shot(tmp_path, Recipe(rate=30, frames=31)))
    assert np.isclose(shot.rigs[0].clip.end - shot.rigs[0].clip.start, 1.0)


def test_motion_does_not_depend_on_the_rate_of_the_stage_that_it_comes_to(tmp_path):
    """A layer of 24 frames a second in a shot of 60, its first frame between two of the shot's."""
    motion = write_shot(tmp_path, Recipe(frames=9), "motion")
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.SetTimeCodesPerSecond(60)
    stage.GetRootLayer().subLayerPaths.append("./motion.usda")
    stage.GetRootLayer().subLayerOffsets[0] = Sdf.LayerOffset(0.3)
    stage.GetRootLayer().Save()
    own, seen = (read_rigs(path)[0].clip for path in (motion, tmp_path / "shot.usda"))
    assert np.allclose(seen.times - seen.start, own.times - own.start)
    # Far keys are joined by straight lines, as renderers do.
    for attribute in stage.GetPrimAtPath("/Hero/Rig/Motion").GetAttributes():
        stage.SetEditTarget(stage.GetRootLayer())
        values = {code: attribute.Get(code) for code in attribute.GetTimeSamples()[::4]}
        for code, value in values.items():
            attribute.Set(value, code)
    stage.GetRootLayer().Save()
    assert len(read_rigs(tmp_path / "shot.usda")[0].clip.times) == 3 + 20


def test_a_pose_is_held_to_the_end_of_the_shot_where_the_animation_begins_before_it(tmp_path):
    """Animation with a run-up, whose exporter left out the samples after the character stopped."""
    path = write_shot(tmp_path, Recipe(frames=9))
    stage = Usd.Stage.Open(str(path))
    stage.SetStartTimeCode(4)
    stage.SetEndTimeCode(30)
    stage.GetRootLayer().Save()
    rig = read_shot(path).rigs[0]
    assert (rig.time_codes[0], rig.time_codes[-1]) == (1, 30)
    np.testing.assert_array_equal(rig.clip.joints[-1], rig.joints_at(9))


def test_rigs_are_read_without_grooms_or_animation(tmp_path):
    path = write_shot(tmp_path, Recipe(frames=0))
    assert len(read_rigs(path)[0].clip.times) == 1
    with pytest.raises(NeuralocksError, match="no animation"):
        read_shot(path)


def test_why_an_animation_does_not_count_is_what_is_wrong_with_it(tmp_path):
    """And not with a mesh, of which something is said later."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath("/Hero/Rig/Motion").GetAttribute("scales").Clear()
    mesh = UsdSkel.BindingAPI.Apply(UsdGeom.Mesh.Define(stage, "/Hero/Empty").GetPrim())
    mesh.CreateSkeletonRel().SetTargets(["/Hero/Rig"])
    mesh.CreateJointIndicesPrimvar(True, 1).Set([3])
    mesh.CreateJointWeightsPrimvar(True, 1).Set([1.0])
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match=r"no animation \(no scales, so UsdSkel ignores the animation\)") as raised:
        read_shot(path)
    assert str(raised.value) in inspect(path)["stops"]


@pytest.mark.parametrize("bound", ["own", "mesh"])
def test_values_at_a_single_time_are_values_at_rest(tmp_path, bound):
    """Exporters of single frames write all that may vary as one sample, transforms and weights too."""
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


def test_a_loop_that_does_not_close_is_said(tmp_path):
    rig = read_shot(write_shot(tmp_path)).rigs[0]
    closed = replace(rig, clip=Clip(rig.clip.times[:3], rig.clip.joints[[0, 1, 0]]))
    assert not closed.loop_notes()
    (note,) = rig.loop_notes()
    assert "/Hero/Rig" in note and "time codes 1 and 9" in note


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
