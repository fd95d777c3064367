# SPDX-License-Identifier: Apache-2.0
"""Hair on a skeleton of its own, as in characters made of modules that follow one leader: its body is the whole character's."""

import numpy as np
import pytest
import trimesh
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from usd.rig.evaluate import evaluate_rig
from usd.rig.picture import rigged_scene
from usd.rig.stage import read_rigged_hair

from ..rig_shots import small_shot


def _ball(stage, path: str, skeleton, at=(0, 1.52, -0.02)) -> None:
    """A head without a scalp around the tail's first joints, moved by the second joint of a skeleton."""
    ball, mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.09), UsdGeom.Mesh.Define(stage, path)
    ball.update_faces((ball.triangles[:, :, 1] < 0.8 * 0.09).all(axis=1))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy((ball.vertices + at).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([3] * len(ball.faces))
    mesh.CreateFaceVertexIndicesAttr(ball.faces.ravel().tolist())
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton])
    binding.CreateJointIndicesPrimvar(False, 1).Set([1] * len(ball.vertices))
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * len(ball.vertices))


def _modular(path):
    """A character whose head is on a second skeleton, without the hair's joints, that moves like the hair's."""
    stage = Usd.Stage.Open(str(small_shot(path)))
    Sdf.CopySpec(stage.GetRootLayer(), "/Who", stage.GetRootLayer(), "/Leader")
    stage.RemovePrim("/Leader/Hair")
    rig, motion = UsdSkel.Skeleton.Get(stage, "/Leader/Rig"), UsdSkel.Animation.Get(stage, "/Leader/Motion")
    for attribute in (rig.GetJointsAttr(), rig.GetBindTransformsAttr(), rig.GetRestTransformsAttr()):
        attribute.Set(attribute.Get()[:2])
    for attribute in (motion.GetJointsAttr(), motion.GetScalesAttr(), motion.GetTranslationsAttr()):
        attribute.Set(attribute.Get()[:2])
    turns = motion.GetRotationsAttr()
    for code in turns.GetTimeSamples():
        turns.Set(turns.Get(code)[:2], code)
    UsdSkel.BindingAPI(rig).GetAnimationSourceRel().SetTargets(["/Leader/Motion"])
    _ball(stage, "/Leader/Skin", "/Leader/Rig")
    stage.GetRootLayer().Save()
    return path


@pytest.mark.parametrize("skeleton", [None, "/Who/Rig"])
def test_hair_is_trained_and_measured_with_the_leaders_body(tmp_path, skeleton):
    stage = Usd.Stage.Open(str(small_shot(tmp_path / "whole.usda")))
    _ball(stage, "/Who/Skin", "/Who/Rig")
    stage.GetRootLayer().Save()
    modular = _modular(tmp_path / "modular.usda")
    one, other = (read_rigged_hair(path, skeleton=skeleton) for path in (tmp_path / "whole.usda", modular))
    bodies = [hair.rig.character.body for hair in (one, other)]
    joints = one.stage_rig.clip.joints[7] @ one.rig.character.inverse_bind
    np.testing.assert_allclose(*(body.posed(joints)[body.triangles] for body in bodies), atol=1e-6)
    assert all(trimesh.Trimesh(body.points, body.triangles).is_watertight for body in bodies)
    cards = [evaluate_rig(path, skeleton=skeleton).measures for path in (tmp_path / "whole.usda", modular)]
    assert cards[0]["body"] == pytest.approx(cards[1]["body"]) and cards[0]["body"]["penetration_percent"] >= 0


def test_a_leader_elsewhere_is_no_body(tmp_path):
    modular = _modular(tmp_path / "modular.usda")
    stage = Usd.Stage.Open(str(modular))
    UsdGeom.Xformable(stage.GetPrimAtPath("/Leader")).AddTranslateOp().Set((1, 0, 0))
    stage.GetRootLayer().Save()
    assert read_rigged_hair(modular).rig.character.body is None


def test_a_picture_shows_the_leaders_head_as_skin(tmp_path):
    """As one of a character in one skeleton, wherever its body is held; also skin that no hair can reach."""
    for name, height in (("head", 1.52), ("shoes", 0.1)):
        stage = Usd.Stage.Open(str(small_shot(tmp_path / f"{name}.usda")))
        _ball(stage, "/Who/Skin", "/Who/Rig", (0, height, -0.02))
        stage.GetRootLayer().Save()
    modular = _modular(tmp_path / "modular.usda")
    whole, shoes, parts = (
        rigged_scene(read_rigged_hair(path)) for path in (tmp_path / "head.usda", tmp_path / "shoes.usda", modular)
    )
    assert [scene.mesh_hair[scene.triangles].all(axis=1).sum() for scene in (whole, shoes, parts)] == [3] * 3
    np.testing.assert_array_equal(parts.mesh_hair[parts.triangles], whole.mesh_hair[whole.triangles])
    np.testing.assert_allclose(parts.body(7)[parts.triangles], whole.body(7)[whole.triangles], atol=1e-6)
