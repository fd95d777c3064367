# SPDX-License-Identifier: Apache-2.0
"""Which skeleton and joint carries a groom, and what is odd about the way it lies there."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.review.inspect import inspect
from usd.shot.stage import read_shot

from ..shots import HEAD, JOINTS, Recipe, add_curves, strand_points, world_points, write_shot


@pytest.mark.parametrize(
    ("bound", "words"), [("own", "own skel binding"), ("mesh", "on which it sits"), ("none", "name")]
)
def test_what_carries_the_groom_is_said(tmp_path, bound, words):
    shot = read_shot(write_shot(tmp_path, Recipe(bound=bound)))
    assert shot.grooms[0].joint == "hips/spine/neck/head"
    assert words in shot.grooms[0].attachment.how
    assert np.abs(shot.grooms[0].groom.points.reshape(40, 12, 3) - strand_points(40, 12)).max() < 1e-6


def _with_a_jaw(path):
    """The shot's stage with a joint below the head, its last one, that opens while the head moves."""
    stage = Usd.Stage.Open(str(path))
    skeleton, motion = UsdSkel.Skeleton.Get(stage, "/Hero/Rig"), UsdSkel.Animation.Get(stage, "/Hero/Rig/Motion")
    joints = [*skeleton.GetJointsAttr().Get(), "hips/spine/neck/head/jaw"]
    down = Gf.Matrix4d().SetTranslate((0, -0.05, 0.08))
    for attribute, matrix in (
        (skeleton.GetBindTransformsAttr(), down * skeleton.GetBindTransformsAttr().Get()[HEAD]),
        (skeleton.GetRestTransformsAttr(), down),
    ):
        attribute.Set([*attribute.Get(), matrix])
    skeleton.GetJointsAttr().Set(joints)
    motion.GetJointsAttr().Set(joints)
    for code in motion.GetRotationsAttr().GetTimeSamples():
        turn = Gf.Quatf(Gf.Rotation((1, 0, 0), 4.0 * code).GetQuat())
        for attribute, own in (
            (motion.GetRotationsAttr(), turn),
            (motion.GetTranslationsAttr(), (0, -0.05, 0.08)),
        ):
            attribute.Set([*attribute.Get(code), own], code)
    motion.GetScalesAttr().Set([*motion.GetScalesAttr().Get(), (1, 1, 1)])
    return stage


def test_hair_on_a_joint_below_the_head_goes_with_it_and_is_still_the_heads(tmp_path):
    path = write_shot(tmp_path, Recipe())
    stage = _with_a_jaw(path)
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/Hair")).GetJointIndicesPrimvar().Set([len(JOINTS)])
    stage.Save()
    found = read_shot(path).grooms[0]
    character, posed = found.attachment.character, found.attachment.rig.joints_at(5.0)
    assert found.joint.endswith("head/jaw") and character.skeleton.names[character.head].endswith("head")
    assert character.canonical_to_bind[:3, 3] == pytest.approx(character.skeleton.bind[HEAD, :3, 3])
    assert np.allclose(character.carrying(posed) @ character.skeleton.bind[-1], posed[-1])
    assert not np.allclose(character.carrying(posed) @ character.skeleton.bind[HEAD], posed[HEAD], atol=1e-3)


@pytest.mark.parametrize(
    ("unit", "followed", "joint"), [(1, HEAD, "head"), (0.01, HEAD, "head"), (1, len(JOINTS), "jaw"), (1, 2, "head")]
)
def test_hair_goes_with_the_joint_that_its_own_transform_follows(tmp_path, model, unit, followed, joint):
    """As tools write the child of a bone, whatever skin is under its roots; but not with a neck, which carries a head."""
    path = write_shot(tmp_path, Recipe(bound="mesh", unit=unit))
    stage = _with_a_jaw(path) if unit == 1 else Usd.Stage.Open(str(path))
    stage.Save()
    rig = read_shot(path).rigs[0]
    op = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero/Hair")).AddTransformOp()
    began = np.linalg.inv(rig.joints_at(1)[followed])
    for frame in range(1, 10):
        way = rig.joints_at(frame)[followed] @ began
        way[:3, 3] /= unit
        op.Set(Gf.Matrix4d(way.T.tolist()), frame)
    stage.Save()
    item = read_shot(path).grooms[0]
    assert item.joint.endswith(joint)
    assert ("its own transform follows" in item.attachment.how) == (followed != 2)
    if followed == 2:
        return
    baked = bake(path, tmp_path / "bake.usdc", model).path
    roots = [world_points(baked, frame)[:: Recipe.vertices] for frame in (1, 5, 9)]
    for frame, found in zip((1, 5, 9), roots):
        way = rig.joints_at(frame)[followed] @ began
        assert np.abs(found - (roots[0] @ way[:3, :3].T + way[:3, 3])).max() < 1e-5


@pytest.mark.parametrize(("unit", "moved"), [(1, 0.03), (0.01, 0.03), (1, 0.005)])
def test_hair_that_moves_relative_to_its_head_is_told(tmp_path, unit, moved):
    """As a beard on a jaw that another skeleton moves."""
    path = write_shot(tmp_path, Recipe(bound="mesh", unit=unit))
    rig, stage = read_shot(path).rigs[0], Usd.Stage.Open(str(path))
    op = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero/Hair")).AddTransformOp()
    began = np.linalg.inv(rig.joints_at(1)[HEAD])
    for frame in range(1, 10):
        way = rig.joints_at(frame)[HEAD] @ began
        way[:3, 3] += moved * (frame - 1) / 8 * way[:3, 1]
        way[:3, 3] /= unit
        op.Set(Gf.Matrix4d(way.T.tolist()), frame)
    stage.Save()
    told = (
        "/Hero/Hair: its own transform moves it by up to 30 mm relative to joint 'head' of /Hero/Rig, which carries it"
    )
    assert [told in note for note in read_shot(path).notes if "its own transform" in note] == [True] * (moved > 0.01)


def _hidden_at(folder, joint: int, code: int, moves: bool, bound: str):
    """A shot in which a scale of zero hides a joint at a frame; hair moves with the head, or stands still."""
    path = write_shot(folder, Recipe(bound=bound))
    rig, stage = read_shot(path).rigs[0], Usd.Stage.Open(str(path))
    ways = [rig.joints_at(frame)[HEAD] @ np.linalg.inv(rig.joints_at(1)[HEAD]) for frame in range(1, 10)]
    op = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero/Hair")).AddTransformOp()
    scales = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion")).GetScalesAttr()
    scales.Clear()
    for frame, way in enumerate(ways, 1):
        if moves:
            op.Set(Gf.Matrix4d(way.T.tolist()), frame)
        scales.Set(Vt.Vec3hArray([Gf.Vec3h(each != joint or frame != code) for each in range(len(JOINTS))]), frame)
    stage.Save()
    return path


def test_a_hidden_hand_takes_no_hair_from_the_head_that_it_follows(tmp_path):
    (item,) = read_shot(_hidden_at(tmp_path, JOINTS.index(f"{JOINTS[4]}/elbow_L"), 5, True, "mesh")).grooms
    assert item.joint == JOINTS[HEAD] and "its own transform follows" in item.attachment.how


@pytest.mark.parametrize(("joint", "head"), [(HEAD, None), (HEAD - 1, None), (HEAD - 1, "neck")])
@pytest.mark.parametrize(
    ("code", "moves", "bound"), [(1, False, "mesh"), (5, False, "own"), (5, True, "mesh"), (1, True, "none")]
)
def test_a_head_that_is_hidden_for_a_frame_is_told(tmp_path, joint, head, code, moves, bound):
    path = _hidden_at(tmp_path, joint, code, moves, bound)
    with pytest.raises(NeuralocksError, match=f"joint 'hips/spine/neck.*' has zero scale at time code {code}; give it"):
        read_shot(path, head=head)


def test_a_joint_below_the_head_that_is_hidden_all_along_is_told_and_nothing_else(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = _with_a_jaw(path)
    skinned = UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/Skin")).GetJointIndicesPrimvar()
    skinned.Set([len(JOINTS) if joint == HEAD else joint for joint in skinned.Get()])
    motion = UsdSkel.Animation.Get(stage, "/Hero/Rig/Motion")
    motion.GetScalesAttr().Set([*motion.GetScalesAttr().Get()[:-1], (0, 0, 0)])
    stage.Save()
    with pytest.raises(NeuralocksError, match="jaw' has zero scale"):
        read_shot(path)


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
    """Any character's hair may lie there in its bind pose."""
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


def test_fur_that_one_joint_cannot_carry_is_said(tmp_path):
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="mesh"))))
    skin = np.array(UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin")).GetPointsAttr().Get())
    add_curves(stage, "/Hero/Fur", np.stack([skin, skin + [0, 0.02, 0]], axis=1))
    stage.GetRootLayer().Save()
    notes = read_shot(stage.GetRootLayer().realPath).notes
    assert sum("will leave the skin" in note for note in notes) == 1
    assert any(note.startswith("/Hero/Fur: only 50%") and "(head)" in note for note in notes)


def test_hair_bound_by_vertex_is_carried_by_what_carries_its_roots(tmp_path):
    """However much of it is painted to move with the chest."""
    path = write_shot(tmp_path)
    plain = read_shot(path)
    stage = Usd.Stage.Open(str(path))
    binding = UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/Hair"))
    strand = np.array([HEAD] + [1] * 11)
    binding.CreateJointIndicesPrimvar(False, 1).Set(Vt.IntArray.FromNumpy(np.tile(strand, 40).astype(np.int32)))
    binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray([1.0] * 480))
    stage.Save()
    shot = read_shot(path)
    assert shot.grooms[0].joint == plain.grooms[0].joint and shot.notes == plain.notes


def test_hair_moved_by_its_own_parents_lies_where_it_began(tmp_path):
    """As exported by tools that bake a head constraint to the groom's transform."""
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


def test_a_groom_of_another_unit_than_the_stage_is_told_so(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh", unit=0.01))
    stage = Usd.Stage.Open(str(path))
    groom = Usd.Stage.CreateNew(str(tmp_path / "groom.usda"))
    UsdGeom.SetStageMetersPerUnit(groom, 1)
    UsdGeom.SetStageUpAxis(groom, "Z")
    add_curves(groom, "/Hair", strand_points(40, 2))
    groom.SetDefaultPrim(groom.GetPrimAtPath("/Hair"))
    groom.Save()
    stage.RemovePrim("/Hero/Hair")
    stage.DefinePrim("/Hero/Groom").GetReferences().AddReference("./groom.usda")
    stage.Save()
    with pytest.raises(
        NeuralocksError, match=r"groom.usda counts in 1 m, the stage in 0.01 m and has Z up, the stage Y"
    ):
        read_shot(path)


def test_blend_shapes_of_a_groom_are_told(tmp_path):
    """A bake leaves them out."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    hair = UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath("/Hero/Hair"))
    shape = UsdSkel.BlendShape.Define(stage, "/Hero/Hair/Lift")
    shape.CreateOffsetsAttr([(0, 0.008, 0)] * len(UsdGeom.BasisCurves(hair).GetPointsAttr().Get()))
    hair.CreateBlendShapesAttr(["lift"])
    hair.CreateBlendShapeTargetsRel().SetTargets([shape.GetPath()])
    stage.Save()
    notes = read_shot(path).notes
    assert any("has blend shapes of its own" in note for note in notes), notes


@pytest.mark.parametrize(("scale", "words"), [((0, 0, 0), "zero scale"), ((-1, 1, 1), "mirrored")])
def test_a_joint_without_a_turn_is_named(tmp_path, scale, words):
    """By a bake, and by `inspect` before it."""
    path = write_shot(tmp_path, Recipe())
    stage = Usd.Stage.Open(str(path))
    animation = UsdSkel.Animation(next(prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Animation)))
    scales = [Gf.Vec3h(1)] * len(animation.GetJointsAttr().Get())
    scales[[str(name).rsplit("/", 1)[-1] for name in animation.GetJointsAttr().Get()].index("arm_L")] = Gf.Vec3h(*scale)
    animation.GetScalesAttr().Set(scales, 1)
    stage.Save()
    with pytest.raises(NeuralocksError, match=f"joint '.*arm_L' .*{words}.* at time code "):
        read_shot(path)
    assert any("arm_L" in line for line in inspect(path)["stops"])
