# SPDX-License-Identifier: Apache-2.0
"""The report card of hair on bones: USD's own skinning and a body whose depths are known say the same."""

import json

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.rig.bake import bake_rig
from usd.rig.evaluate import evaluate_rig
from usd.rig.stage import read_rigged_hair

from ..commands import status
from ..rig_shots import EXAMPLE, model_for, small_shot


def hair_by_usd(stage, codes, mesh="/Who/Hair", rig="/Who/Rig", head=1):
    """Vertices (T, V, 3) of a hair mesh in the frame of its head joint, in the stage's units, by UsdSkel alone."""
    cache, skel_root = UsdSkel.Cache(), UsdSkel.Root(stage.GetPrimAtPath("/Who"))
    cache.Populate(skel_root, Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath(rig)))
    skinning = cache.GetSkinningQuery(stage.GetPrimAtPath(mesh))
    found = []
    for code in codes:
        points = UsdGeom.Mesh(stage.GetPrimAtPath(mesh)).GetPointsAttr().Get(code)
        joints = query.ComputeSkinningTransforms(code)
        skinning.ComputeSkinnedPoints(joints, points, code)
        place = np.array(query.ComputeJointSkelTransforms(code))[head]
        found.append((np.c_[np.array(points), np.ones(len(points))] @ np.linalg.inv(place))[:, :3])
    return np.stack(found)


@pytest.mark.parametrize(("scale", "z_up"), [(1.0, False), (100.0, True)])
def test_swing_is_what_usd_shows(tmp_path, scale, z_up):
    shot = small_shot(tmp_path / "shot.usda", scale=scale, z_up=z_up)
    baked = bake_rig(shot, tmp_path / "baked.usda", model_for(read_rigged_hair(shot))).path
    card = evaluate_rig(baked).measures
    codes = range(25)
    moved, stiff = (hair_by_usd(Usd.Stage.Open(str(path)), codes) for path in (baked, shot))
    # In the shot itself the tail is animated, too: rigid is the place of its first frame, that of the bind pose.
    off = np.linalg.norm(moved - stiff[0], axis=-1) / scale
    assert card["frames"] == 25 and card["vertices"] == 9 and card["joints"] == 3
    assert card["swing_mm"] == pytest.approx(1e3 * np.sqrt(np.square(off).mean()), rel=1e-3)
    assert card["swing_most"] == "hair_0" and "body" not in card


def test_depths_are_those_of_a_known_body(tmp_path):
    """A wall 5 mm behind where the tail rests: how much of it goes in, and how deep, is known of each vertex."""
    shot = small_shot(tmp_path / "shot.usda")
    baked = bake_rig(shot, tmp_path / "baked.usda", model_for(read_rigged_hair(shot))).path
    stage = Usd.Stage.Open(str(baked))
    moved, head = hair_by_usd(stage, range(25)), np.array([0, 1.5, 0])
    wall = hair_by_usd(Usd.Stage.Open(str(shot)), [0])[0][:, 2].min() - 0.005
    box = UsdGeom.Mesh.Define(stage, "/Who/Wall")
    corners = np.array([[x, y, z] for x in (-0.15, 0.15) for y in (-0.15, 0.15) for z in (wall - 0.1, wall)]) + head
    box.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(corners.astype(np.float32)))
    box.CreateFaceVertexCountsAttr([4] * 6)
    box.CreateFaceVertexIndicesAttr([0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3])
    binding = UsdSkel.BindingAPI.Apply(box.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/Who/Rig"])
    binding.CreateJointIndicesPrimvar(False, 1).Set([1] * 8)
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 8)
    stage.GetRootLayer().Save()
    depth = np.maximum(wall - moved[..., 2], 0)
    assert depth.max() > 0.005, "the tail does not reach the wall"
    card = evaluate_rig(baked).measures
    assert card["body_frames"] == 25
    assert card["body"]["penetration_worst_mm"] == pytest.approx(1e3 * depth.max(), abs=0.01)
    assert card["body"]["penetration_percent"] == pytest.approx(100 * (depth > 2e-6).mean(), abs=0.01)
    assert card["body"]["penetration_3mm_percent"] == pytest.approx(100 * (depth > 3e-3).mean(), abs=0.5)
    assert card["body"]["deepest_at"] == depth.max(axis=1).argmax() and card["body"]["deepest"] == "hair_0"
    assert card["body_rigid"]["penetration_worst_mm"] == 0


def test_a_bake_keeps_hair_out_and_rests_and_the_command_says_so(tmp_path, capsys):
    baked = bake_rig(EXAMPLE / "shot.usda", tmp_path / "baked.usdc", EXAMPLE / "quasi_static.neuralocks").path
    assert status("rig", "evaluate", baked, "--json") == 0
    card = json.loads(capsys.readouterr().out)
    assert card["skeleton"] == "/Body/Rig" and card["frames"] == 193 and card["notes"] == []
    body, rigid = card["body"], card["body_rigid"]
    assert body["penetration_percent"] < 0.1 * rigid["penetration_percent"]
    assert body["penetration_worst_mm"] < 0.3 * rigid["penetration_worst_mm"]


def test_hair_that_does_not_move_is_told(tmp_path, capsys):
    shot = small_shot(tmp_path / "shot.usda")
    stage = Usd.Stage.Open(str(shot))
    turns = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
    bind, head = turns.Get(0), [turns.Get(code)[1] for code in range(25)]
    for code in range(25):
        turns.Set([*bind[:1], head[code], *bind[2:]], code)
    stage.GetRootLayer().Save()
    assert status("rig", "evaluate", shot) == 0
    assert "swing: none, as if hair were carried rigidly" in capsys.readouterr().out


def test_a_held_pose_rests(tmp_path):
    """The head stands still: hair of held poses does, too, and what trembles is told."""
    shot = small_shot(tmp_path / "shot.usda", frames=96)
    stage = Usd.Stage.Open(str(shot))
    turns = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
    for code in range(6, 97):
        turns.Set(turns.Get(5), code)
    stage.GetRootLayer().Save()
    baked = bake_rig(shot, tmp_path / "baked.usda", model_for(read_rigged_hair(shot))).path
    assert evaluate_rig(baked).measures["jitter_mm"] == 0
    stage = Usd.Stage.Open(str(baked))
    turns = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Rig/NeuralocksHair")).GetRotationsAttr()
    rotations = turns.Get(90)
    rotations[2] = type(rotations[2])(np.cos(0.005), np.sin(0.005), 0, 0) * rotations[2]
    turns.Set(rotations, 90)
    stage.GetRootLayer().Save()
    # By a hundredth of a radian about the first joint, from which the farthest vertex is 0.15 m away.
    assert 0.5 < evaluate_rig(baked).measures["jitter_mm"] < 1.6


def test_what_cannot_be_measured_is_one_line(tmp_path):
    with pytest.raises(NeuralocksError, match="/Body/Rig: is not animated; give a bake, or an animated character"):
        evaluate_rig(EXAMPLE / "character.usda")
    shot = small_shot(tmp_path / "shot.usda")
    stage = Usd.Stage.Open(str(shot))
    stage.RemovePrim("/Who/Hair")
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match="/Who/Rig: no mesh is skinned to its hair joints; there is nothing"):
        evaluate_rig(shot)
