# SPDX-License-Identifier: Apache-2.0
"""Which joint is the head that hair grows on: told by its name, by bindings, by hand, or by an earlier bake."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.review.baked import read_baked
from usd.review.evaluate import evaluate
from usd.review.facts_text import as_text
from usd.review.inspect import inspect
from usd.shot.stage import read_shot

from ..shots import CENTRE, HEAD, RADIUS, Recipe, strand_points, write_shot


def test_a_head_by_hand_serves_where_no_binding_speaks(tmp_path):
    free = read_shot(write_shot(tmp_path, Recipe(bound="none"), "free"), head="neck")
    assert free.grooms[0].joint == "hips/spine/neck"
    path = write_shot(tmp_path, Recipe(), "bound")
    bound = read_shot(path, head="neck")
    assert bound.grooms[0].joint == "hips/spine/neck/head"
    said = set(bound.notes) - set(read_shot(path).notes)
    assert len(said) == 1 and "--head neck is not used" in said.pop(), "nor is what it would have spoiled a matter"
    for joints, count in (({"head": "neck"}, 1), ({"head": "head"}, 0)):
        notes = read_shot(path, joints=joints).notes
        assert sum("--joint head=neck is not used, the groom is carried by" in note for note in notes) == count


def _without_a_head_by_name(path):
    path.write_text(path.read_text().replace("spine/neck", "spine/Hals").replace("Hals/head", "Hals/Kopf"))
    return path


@pytest.mark.parametrize("bound", ["own", "mesh"])
def test_a_binding_tells_the_head_where_no_name_does(tmp_path, bound):
    named = read_shot(write_shot(tmp_path, Recipe(bound=bound), "named")).grooms[0]
    path = _without_a_head_by_name(write_shot(tmp_path, Recipe(bound=bound)))
    found = read_shot(path).grooms[0]
    assert found.joint == "hips/spine/Hals/Kopf"
    assert found.attachment.character.humanoid.joints == named.attachment.character.humanoid.joints
    assert np.array_equal(found.groom.points, named.groom.points)
    (skeleton,) = inspect(path)["skeletons"]
    assert skeleton["head"] == found.joint and "by the binding of /Hero/" in skeleton["head found"]
    stage = Usd.Stage.Open(str(path))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Hair", stage.GetRootLayer(), "/Hero/Ruff")
    ruff = UsdSkel.BindingAPI.Apply(stage.GetPrimAtPath("/Hero/Ruff"))
    ruff.CreateSkeletonRel().SetTargets(["/Hero/Rig"])
    ruff.CreateJointIndicesPrimvar(True, 1).Set([1])
    ruff.CreateJointWeightsPrimvar(True, 1).Set([1.0])
    UsdGeom.BasisCurves(ruff).GetCurveVertexCountsAttr().Set([6] * 10)
    UsdGeom.BasisCurves(ruff).GetPointsAttr().Set([(0, 1.4, 0.01 * i) for i in range(60)])
    stage.Save()
    shot = read_shot(path)
    assert [item.joint for item in shot.grooms] == [found.joint, "hips/spine"]
    assert not any("is not used" in note for note in shot.notes), "the head was not named by hand"


@pytest.mark.parametrize("bound", ["own", "mesh"])
def test_the_roots_of_strands_from_tip_to_root_tell_the_head(tmp_path, bound):
    """The tips lie on the chest, or are painted to move with it."""
    path = _without_a_head_by_name(write_shot(tmp_path, Recipe(bound=bound)))
    stage = Usd.Stage.Open(str(path))
    scalp = strand_points(40, 2)[:, 0]
    chest = np.array([0, 1.3, 0]) + 0.155 * (scalp - CENTRE) / RADIUS
    strands = (chest[:, None] + np.linspace(0, 1, 12)[:, None] * (scalp - chest)[:, None]).reshape(-1, 3)
    hair = stage.GetPrimAtPath("/Hero/Hair")
    UsdGeom.BasisCurves(hair).GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(strands, np.float32)))
    if bound == "own":
        joints = np.tile(np.int32([1] * 6 + [HEAD] * 6), 40)
        binding = UsdSkel.BindingAPI(hair)
        binding.CreateJointIndicesPrimvar(False, 1).Set(Vt.IntArray.FromNumpy(joints))
        binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray([1.0] * len(joints)))
    stage.Save()
    shot = read_shot(path)
    (item,) = shot.grooms
    assert sum("from tip to root" in note for note in shot.notes) == 1
    head = item.attachment.rig.joints.names[item.attachment.character.head]
    assert (item.joint, head) == ("hips/spine/Hals/Kopf",) * 2
    assert not any("is not used" in note for note in shot.notes)


def test_a_hat_takes_no_hair_from_the_head_under_it(tmp_path):
    """The hat's skeleton has no joint named like a head, and hair sits on its mesh as well as on the skin."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    layer = stage.GetRootLayer()
    for name, copy in (("Rig", "A_Hat"), ("Skin", "A_Felt")):
        Sdf.CopySpec(layer, f"/Hero/{name}", layer, f"/Hero/{copy}")
    hat = UsdSkel.Skeleton(stage.GetPrimAtPath("/Hero/A_Hat"))
    joints = [joint.replace("neck", "band").replace("head", "crown") for joint in hat.GetJointsAttr().Get()]
    hat.GetJointsAttr().Set(joints)
    stage.GetPrimAtPath("/Hero/A_Hat/Motion").GetAttribute("joints").Set(joints)
    UsdSkel.BindingAPI(hat.GetPrim()).GetAnimationSourceRel().SetTargets(["/Hero/A_Hat/Motion"])
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/A_Felt")).GetSkeletonRel().SetTargets(["/Hero/A_Hat"])
    layer.Save()
    shot = read_shot(path)
    assert shot.grooms[0].attachment.rig.path == "/Hero/Rig"
    assert any("/Hero/A_Hat: no joint is named like a head" in note for note in shot.notes)
    assert read_shot(path, skeleton="/Hero/A_Hat").grooms[0].joint == "hips/spine/band/crown"


def test_a_bake_tells_the_head_that_its_user_named(tmp_path):
    path = _without_a_head_by_name(write_shot(tmp_path, Recipe(bound="none")))
    with pytest.raises(NeuralocksError, match="no joint is named like a head; name it with --head JOINT"):
        read_shot(path)
    bake(path, tmp_path / "bake.usda", head="Kopf", frames="1:2")
    assert read_baked(tmp_path / "bake.usda").shot.grooms[0].joint == "hips/spine/Hals/Kopf"


def test_a_bake_tells_the_head_where_another_joint_is_named_like_one(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="none"))
    bake(path, tmp_path / "bake.usda", head="neck", frames="1:3")
    again = read_baked(tmp_path / "bake.usda")
    assert again.shot.grooms[0].joint == "hips/spine/neck"
    assert not any("--head" in note for note in again.shot.notes)
    named = read_baked(tmp_path / "bake.usda", head="hips/spine/neck/head")
    assert named.shot.grooms[0].joint == "hips/spine/neck/head", "what the user says now wins"
    assert evaluate(tmp_path / "bake.usda").to_json() == evaluate(tmp_path / "bake.usda", head="neck").to_json()


def test_a_broken_binding_that_would_tell_the_head_is_named_first(tmp_path):
    path = _without_a_head_by_name(write_shot(tmp_path, Recipe()))
    stage = Usd.Stage.Open(str(path))
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/Hair")).GetJointIndicesPrimvar().GetAttr().Set([99])
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match="^/Hero/Hair: a joint index lies outside 0..7"):
        read_shot(path)


def test_curves_that_cannot_be_read_do_not_hide_the_binding_that_tells_the_head(tmp_path):
    path = _without_a_head_by_name(write_shot(tmp_path, Recipe()))
    stage = Usd.Stage.Open(str(path))
    cable = UsdGeom.BasisCurves.Define(stage, "/Set/Cable").GetPrim()
    cable.RemoveProperty("points")
    spec = stage.GetRootLayer().GetPrimAtPath("/Set/Cable")
    Sdf.AttributeSpec(spec, "points", Sdf.ValueTypeNames.StringArray).default = ["a", "b"]
    stage.GetRootLayer().Save()
    assert read_shot(path, grooms=["/Hero/Hair"]).grooms[0].joint == "hips/spine/Hals/Kopf"


def test_joints_are_listed_where_the_user_is_asked_for_the_head(tmp_path):
    path = _without_a_head_by_name(write_shot(tmp_path, Recipe(bound="none")))
    text = as_text(inspect(path))
    assert "/Hero/Rig: no joint is named like a head; name it with --head JOINT" in text
    assert "skeletons left out:\n  path: /Hero/Rig\n  joint names: hips, spine, Hals, Kopf, arm_L" in text
    assert "skeletons left out" not in inspect(path, head="Kopf")
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath("/Hero/Rig").RemoveProperty("joints")
    rig = stage.GetRootLayer().GetPrimAtPath("/Hero/Rig")
    Sdf.AttributeSpec(rig, "joints", Sdf.ValueTypeNames.IntArray).default = [1]
    stage.GetRootLayer().Save()
    assert "its joints are int[], not token[]" in as_text(inspect(path))
