# SPDX-License-Identifier: Apache-2.0
"""Pictures of mesh hair: what is hair of a skinned mesh, and that it moves."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from pxr import Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.rig.bake import bake_rig
from usd.rig.picture import rigged_scene
from usd.rig.stage import read_rigged_hair

from ..rig_shots import EXAMPLE, model_for, small_shot
from ..shots import write_shot


def test_a_picture_of_mesh_hair(tmp_path):
    """Whole locks are hair, including their roots on the head, and nothing of the body is; hair that moves is drawn elsewhere."""
    pytest.importorskip("PIL", reason="the extra 'preview' is not installed")
    from PIL import Image

    from usd.review.picture import preview

    baked = tmp_path / "baked.usda"
    bake_rig(EXAMPLE / "shot.usda", baked)
    stage = Usd.Stage.Open(str(baked))  # a cable in the set, which is not hair
    cable = UsdGeom.BasisCurves.Define(stage, "/Set/Cable")
    cable.CreatePointsAttr([(3, 0, 0), (3, 4, 0)])
    cable.CreateCurveVertexCountsAttr([2])
    stage.GetRootLayer().Save()
    rigged = read_rigged_hair(baked)
    scene, meshes = rigged_scene(rigged), rigged.stage_rig.meshes
    begin = 0
    for mesh in meshes:
        end = begin + len(mesh.points)
        assert (scene.mesh_hair[begin:end] == ("hair" in mesh.prim.GetName().lower())).all()
        begin = end
    picture = np.asarray(Image.open(preview(baked, tmp_path / "hair.png", size=(120, 160))).convert("RGB"), float)
    assert picture.shape == (160, 6 * 124 - 4, 3)
    brown = picture[..., 0] - picture[..., 2] > 30
    panels = [brown[:, i * 124 : i * 124 + 120] for i in range(6)]
    assert all(panel.mean() > 0.02 for panel in panels)
    assert (panels[0] != panels[4]).mean() > 0.02


def test_skin_in_one_mesh_with_thick_hair_is_no_hair(tmp_path):
    """Locks that begin at the skin's vertices make one piece with it, most of which is hair."""
    ball = trimesh.creation.icosphere(2, 0.1)
    skin, tops = ball.vertices + [0, 1.52, -0.02], np.flatnonzero(ball.vertices[:, 1] > 0.02)
    locks = np.concatenate([skin[top] + np.outer(range(4), [0.0, -0.01, -0.03]) for top in tops])
    first = len(skin) + 4 * np.arange(len(tops))[:, None, None]
    faces = np.concatenate([ball.faces, (first + [[0, 1, 2], [1, 3, 2]]).reshape(-1, 3)])
    joints = [*np.where(ball.vertices[:, 1] < -0.06, 0, 1).tolist(), *[1, 2, 3, 4] * len(tops)]
    path = small_shot(tmp_path / "shot.usda")
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh.Get(stage, "/Who/Hair")
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(np.concatenate([skin, locks]).astype(np.float32)))
    mesh.GetFaceVertexCountsAttr().Set([3] * len(faces))
    mesh.GetFaceVertexIndicesAttr().Set(faces.ravel().tolist())
    binding = UsdSkel.BindingAPI(mesh.GetPrim())
    binding.GetJointIndicesPrimvar().Set(joints)
    binding.GetJointWeightsPrimvar().Set([1.0] * len(joints))
    stage.GetRootLayer().Save()
    hair = rigged_scene(read_rigged_hair(path, chains=["hair_0"])).mesh_hair
    assert not hair[: len(skin)].any() and hair[len(skin) :].all() and hair.mean() > 0.5


def test_of_several_characters_one_that_is_baked_is_drawn(tmp_path):
    shot = small_shot(tmp_path / "one.usda")
    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name in ("A", "B"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(str(shot))
    stage.Save()
    model = model_for(read_rigged_hair(shot))
    baked = bake_rig(tmp_path / "two.usda", tmp_path / "out.usda", model, skeleton="/B/Rig").path
    assert read_rigged_hair(baked, baked_first=True).stage_rig.path == "/B/Rig"
    assert read_rigged_hair(tmp_path / "two.usda", baked_first=True).stage_rig.path == "/A/Rig"
    with pytest.raises(NeuralocksError, match="2 skeletons have hair chains"):
        read_rigged_hair(baked)
    both = bake_rig(tmp_path / "two.usda", tmp_path / "both.usda", model).path
    assert read_rigged_hair(both, baked_first=True).stage_rig.path == "/A/Rig"
    UsdGeom.Imageable(stage.GetPrimAtPath("/A")).MakeInvisible()  # its message was that no mesh is skinned
    stage.Save()
    drawn = read_rigged_hair(both, baked_first=True)
    assert drawn.stage_rig.path == "/B/Rig" and drawn.others == ("/A/Rig",)


def test_joints_without_a_mesh_have_no_picture(tmp_path):
    pytest.importorskip("PIL", reason="the extra 'preview' is not installed")
    from usd.review.picture import preview

    path = small_shot(tmp_path / "shot.usda")
    stage = Usd.Stage.Open(str(path))
    stage.RemovePrim("/Who/Hair")
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match="no mesh"):
        preview(path, tmp_path / "hair.png")
    assert not (tmp_path / "hair.png").exists()


def test_a_character_without_hair_is_no_bake(tmp_path):
    from usd.review.picture import preview

    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    stage.RemovePrim("/Hero/Hair")
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match=r"shot.usda: holds no groom and no hair chains; give a bake$"):
        preview(path, tmp_path / "hair.png")


def test_each_picture_shows_the_pose_of_its_sample(tmp_path):
    """Vertices follow the joint that drives them; a film begins anew where the shot is cut, but for a loop, which has no cuts."""
    rigged = read_rigged_hair(small_shot(tmp_path / "shot.usda"))
    stage_rig, body = rigged.stage_rig, rigged.stage_rig.character.body
    clip = stage_rig.clip
    scene = rigged_scene(replace(rigged, stage_rig=replace(stage_rig, clip=replace(clip, cuts=clip.times[2:3]))))
    assert np.array_equal(scene.times, clip.times) and np.array_equal(scene.cuts, clip.times[2:3])
    assert len(rigged_scene(replace(rigged, stage_rig=replace(stage_rig, clip=replace(clip, loop=True)))).cuts) == 0
    joint, rest = body.joint_indices[:, 0], np.append(body.points, np.ones((len(body.points), 1)), axis=1)
    assert (body.joint_weights[:, 0] == 1).all()
    for frame in (0, 3, len(clip.times) - 1):
        moved = clip.joints[frame] @ np.linalg.inv(stage_rig.character.skeleton.bind)
        np.testing.assert_allclose(scene.body(frame), np.einsum("vij,vj->vi", moved[joint], rest)[:, :3], atol=1e-5)
        np.testing.assert_allclose(scene.head[frame], moved[stage_rig.character.head], atol=1e-5)
    assert np.abs(scene.body(3) - scene.body(0)).max() > 1e-3
