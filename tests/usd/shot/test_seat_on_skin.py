# SPDX-License-Identifier: Apache-2.0
"""Hair is where it lies on the skin, however that is measured: between places near to each other, on wide faces, of a crowd."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from usd.baking.bake import bake
from usd.border.placement import Placement
from usd.shot.carriers.seat import NEAR, find_seat
from usd.shot.stage import read_rigs, read_shot
from usd.skel import skin, surface

from ..shots import CENTRE, HEAD, Recipe, world_points, write_shot


@pytest.mark.parametrize("off", [0.0, 0.002, 0.005, None])
def test_hair_made_near_its_place_in_the_bind_pose_lies_where_it_is_on_the_skin(tmp_path, off):
    """If the head has moved by less than the distance within which hair sits on it, also where hair hovers; but not where roots lie on
    the skin in neither place.
    """
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    still = np.asarray(motion.GetTranslationsAttr().Get(1))
    way = np.array([0.012, 0.0, 0.012])
    for code in range(1, 10):
        motion.GetRotationsAttr().Set(Vt.QuatfArray([Gf.Quatf(1)] * len(still)), code)
        moved = still + way * (np.arange(len(still)) == 0)[:, None] * (1 + 0.1 * (code - 1))
        motion.GetTranslationsAttr().Set(Vt.Vec3fArray.FromNumpy(moved.astype(np.float32)), code)
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    rest = np.asarray(points.Get())
    ragged = np.random.default_rng(3).uniform(-0.02, 0.03, (40, 1)).repeat(12, axis=0)
    made = CENTRE + (rest - CENTRE) * (1 + (ragged if off is None else off) / 0.1)
    points.Set(Vt.Vec3fArray.FromNumpy((made + way).astype(np.float32)))
    stage.Save()
    (item,) = read_shot(path).grooms
    np.testing.assert_allclose(item.groom.points, made + way * (off is None), atol=1e-6)


@pytest.mark.parametrize("degrees", [10, 20, -15])
def test_hair_that_begins_off_the_skin_is_not_taken_from_another_rest_pose(tmp_path, degrees):
    """A ponytail that is tied behind the head, of a character whose rest pose is another: a note says that it is off."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    rests = UsdSkel.Skeleton(stage.GetPrimAtPath("/Hero/Rig")).GetRestTransformsAttr()
    bent, angle = np.array(rests.Get()), np.radians(degrees)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), np.sin(angle)], [0, -np.sin(angle), np.cos(angle)]])
    bent[2, :3, :3] = bent[2, :3, :3] @ turn
    rests.Set(Vt.Matrix4dArray.FromNumpy(bent))
    tied = CENTRE + [0, 0.03, -0.15] + np.random.default_rng(0).uniform(-0.01, 0.01, (40, 1, 3))
    hair = (tied + np.linspace(0, 0.3, 12)[:, None] * [0, 0, -1]).reshape(-1, 3).astype(np.float32)
    UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(hair))
    stage.Save()
    shot = read_shot(path)
    np.testing.assert_allclose(shot.grooms[0].groom.points, hair, atol=1e-6)
    assert any("from the skin" in note for note in shot.notes), shot.notes


@pytest.mark.parametrize("lifted", [0.0, 0.4], ids=["some_roots_far", "most_roots_far"])
def test_a_seat_within_a_bound_is_the_seat(tmp_path, lifted):
    """A crowd is searched with a bound: what is beyond it is not measured, and must not change the result."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    moved = np.asarray(points.Get()).reshape(40, 12, 3).copy()
    moved[:15, :, 1] += 0.5
    moved[15:, :, 1] += lifted
    points.Set(Vt.Vec3fArray.FromNumpy(moved.reshape(-1, 3)))
    (rig,), prim = read_rigs(path), stage.GetPrimAtPath("/Hero/Hair")
    seat, bounded = (find_seat(prim, rig, Placement(prim), *within) for within in ((), (NEAR,)))
    assert (bounded is None) == (seat.distance > NEAR) == bool(lifted)
    if bounded is not None:
        assert bounded.distance == seat.distance
        np.testing.assert_array_equal(bounded.points, seat.points)


def test_hair_sits_in_the_middle_of_wide_faces(tmp_path):
    """A large head, or one with few vertices: hair far from every corner must not count as off the skin."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    mesh, curves = (UsdGeom.PointBased(stage.GetPrimAtPath(f"/Hero/{name}")) for name in ("Skin", "Hair"))
    corners = CENTRE + 0.12 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(corners.astype(np.float32)))
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    UsdGeom.Mesh(mesh).GetFaceVertexCountsAttr().Set([4] * 6)
    UsdGeom.Mesh(mesh).GetFaceVertexIndicesAttr().Set(np.ravel(sides).tolist())
    # The lower corners follow another joint: what hair rides on is decided by the corners near to it.
    binding = UsdSkel.BindingAPI(mesh)
    binding.GetJointIndicesPrimvar().Set([1, 1, HEAD, HEAD] * 2)
    binding.GetJointWeightsPrimvar().Set([1.0] * 8)
    across = np.array([(x, 0, z) for x in np.linspace(-0.05, 0.05, 8) for z in np.linspace(-0.05, 0.05, 5)])
    points = CENTRE + across[:, None] + np.linspace(0.12, 0.3, 12)[:, None] * [0, 1, 0]
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    stage.Save()
    shot = read_shot(path)
    (item,) = shot.grooms
    assert item.joint.endswith("/head") and "(binding of /Hero/Skin, on which it sits)" in item.attachment.how
    assert not [note for note in shot.notes if "from the skin" in note]
    (rig,) = read_rigs(path)
    prim = stage.GetPrimAtPath("/Hero/Hair")
    seat = find_seat(prim, rig, Placement(prim))
    assert seat.distance < 0.02 and {*seat.points} == {2, 3, 6, 7}


def test_a_crowds_skins_are_found_and_sorted_once_each(tmp_path, monkeypatch):
    """Not once for each character or groom: reading 24 of 13,000 points would take half a minute."""
    write_shot(tmp_path, Recipe(bound="mesh"), "asset")
    stage = Usd.Stage.CreateNew(str(tmp_path / "crowd.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for number in range(4):
        prim = stage.DefinePrim(f"/C{number}")
        prim.GetReferences().AddReference("./asset.usda")
        UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(number, 0, 0))
    stage.Save()
    sorted_, tree = [], skin.surface_tree
    monkeypatch.setattr(skin, "surface_tree", lambda points: sorted_.append(len(points)) or tree(points))
    asked, bound = [], surface.bound_skeleton
    monkeypatch.setattr(surface, "bound_skeleton", lambda prim: asked.append(prim.GetPath()) or bound(prim))
    assert len(read_shot(stage.GetRootLayer().realPath).grooms) == 4
    assert len(sorted_) == len(asked) == 4


@pytest.mark.parametrize("size", [(0.99, 0.99, 0.99), (1, 0.99, 1), (1.02, 0.985, 0.98)], ids=str)
@pytest.mark.parametrize("bound, lift", [("mesh", 0.02), ("mesh", 0.06), ("none", 0.0)])
def test_below_a_scaled_parent_hair_that_hovers_over_the_skin_stays_where_it_is_seen(
    tmp_path, still_model, bound, lift, size
):
    """Scaled once more, it would be nearer to the skin, or to the joint."""
    path = write_shot(tmp_path, Recipe(bound=bound, place=np.diag([*size, 1.0])))
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    points.Set(Vt.Vec3fArray.FromNumpy((np.asarray(points.Get()) + [0, lift, 0]).astype(np.float32)))
    stage.Save()
    seen = world_points(path, 1)
    shot = read_shot(path)
    np.testing.assert_allclose(shot.grooms[0].groom.points, seen, atol=1e-6)
    out = bake(shot, tmp_path / "hair.usdc", still_model).path
    np.testing.assert_allclose(world_points(out, 1), seen, atol=1e-5)
