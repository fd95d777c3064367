# SPDX-License-Identifier: Apache-2.0
"""Where curves without a binding are in the bind pose, in scenes where no frame shows the bind pose."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.border.placement import Placement
from usd.review.baked import read_baked
from usd.shot import ways
from usd.shot.seat import NEAR, find_seat
from usd.shot.stage import read_rigs, read_shot
from usd.skel import skin, surface

from ..shots import CENTRE, HEAD, Recipe, world_points, write_shot

START = 4
"""Time code at which a character that turns its head from the first frame on is first seen."""


def _turned(tmp_path, bound, nesting="/Hero") -> tuple[Usd.Stage, np.ndarray]:
    """A shot in which the head is turned when the motion begins, and where it is at each frame relative to its bind pose."""
    path = write_shot(tmp_path, Recipe(bound=bound, nesting=nesting))
    stage = Usd.Stage.Open(str(path))
    motion = UsdSkel.Animation(stage.GetPrimAtPath(f"{nesting}/Rig/Motion"))
    for attribute in (motion.GetTranslationsAttr(), motion.GetRotationsAttr()):
        for code in range(1, START):
            attribute.ClearAtTime(code)
    stage.SetStartTimeCode(START)
    stage.Save()
    (rig,) = read_rigs(path)
    bind = np.linalg.inv(rig.character.skeleton.bind[HEAD])
    return stage, np.stack([rig.joints_at(code)[HEAD] @ bind for code in range(10)])


def _rigid(points, matrix) -> Vt.Vec3fArray:
    return Vt.Vec3fArray.FromNumpy((np.asarray(points) @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32))


@pytest.mark.parametrize("bound", ["mesh", "none"])
def test_a_moving_cache_is_where_it_is_seen(tmp_path, still_model, bound):
    stage, head = _turned(tmp_path, bound)
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    rest = np.asarray(points.Get())
    points.Clear()
    for code in range(START, 10):
        points.Set(_rigid(rest, head[code]), code)
    stage.Save()
    shot = read_shot(stage.GetRootLayer().realPath)
    np.testing.assert_allclose(shot.grooms[0].groom.points, rest, atol=1e-6)
    assert any("no points at the default time; those at time code 4" in note for note in shot.notes)
    # The bake, read back, has the same rest shape, and the hair is where it was seen.
    baked = read_baked(bake(shot, tmp_path / "hair.usdc", still_model).path)
    (item,) = baked.shot.grooms
    np.testing.assert_allclose(item.groom.points, rest, atol=1e-6)
    for code in baked.codes:
        np.testing.assert_allclose(baked.world(item, code), points.Get(code), atol=1e-6)


def test_a_bake_of_hair_with_a_single_sample_knows_its_shape_at_rest(tmp_path, model):
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="mesh"))))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    rest = points.Get()
    points.Clear()
    points.Set(rest, 5)
    stage.Save()
    shot = read_shot(stage.GetRootLayer().realPath)
    again = read_shot(bake(shot, tmp_path / "hair.usdc", model).path)
    np.testing.assert_array_equal(again.grooms[0].groom.points, shot.grooms[0].groom.points)


@pytest.mark.parametrize("bound", ["mesh", "none"])
def test_hair_below_a_moving_root_is_at_rest_however_the_head_is_turned_when_it_begins(tmp_path, bound):
    stage, _ = _turned(tmp_path, bound)
    before = read_shot(stage.GetRootLayer().realPath).grooms[0].groom.points
    walk = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddTranslateOp()
    for code in range(START, 10):
        walk.Set(Gf.Vec3d(0.1 * code - 0.1 * START, 0, 0), code)
    stage.Save()
    np.testing.assert_allclose(read_shot(stage.GetRootLayer().realPath).grooms[0].groom.points, before, atol=1e-6)


def test_hair_of_an_animated_set_in_which_the_character_walks_is_not_taken_from_the_head(tmp_path):
    stage, _ = _turned(tmp_path, "mesh", "/Train/Hero")
    layer = stage.GetRootLayer()
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Train/Hero/Hair")).GetPointsAttr()
    # If it hovers over skin, one place is hardly nearer to the skin than another.
    rest = np.asarray(points.Get()) + [0, 0.015, 0]
    points.Set(_rigid(rest, np.eye(4)))
    Sdf.CopySpec(layer, "/Train/Hero/Hair", layer, "/Train/Hair")
    stage.RemovePrim("/Train/Hero/Hair")
    train, walk = (UsdGeom.Xformable(stage.GetPrimAtPath(path)) for path in ("/Train", "/Train/Hero"))
    ride, steps = train.AddTransformOp(), walk.AddTranslateOp()
    for code in range(START, 10):
        turn = Gf.Matrix4d().SetRotate(Gf.Rotation((0, 1, 0), 3.0 * code))
        ride.Set(turn * Gf.Matrix4d().SetTranslate((20, 0, 0.5 * code)), code)
        steps.Set((0, 0, 0.1 * (code - START)), code)
    stage.Save()
    shot = read_shot(layer.realPath)
    np.testing.assert_allclose(shot.grooms[0].groom.points, rest, atol=1e-5)
    (note,) = (note for note in shot.notes if note.startswith("/Train/Hair: "))
    assert "is neither that of /Train/Hero/Rig nor of the head" in note and "bind it" in note


@pytest.mark.parametrize("away", [0.0, 1e4])
def test_hair_that_rises_with_the_head_is_taken_from_there_far_from_the_origin_too(tmp_path, away):
    """A step aside is small compared with ten kilometres, but still a step aside."""
    place = np.eye(4)
    place[0, 3] = away
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="none", place=place))))
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    op, still = curves.AddTranslateOp(), np.asarray(motion.GetTranslationsAttr().Get(1))
    for code in range(1, 10):
        step = np.array([0.1, 0.02 * code, 0])
        motion.GetRotationsAttr().Set(Vt.QuatfArray([Gf.Quatf(1)] * len(still)), code)
        motion.GetTranslationsAttr().Set(Vt.Vec3fArray.FromNumpy(np.float32([still[0] + step, *still[1:]])), code)
        op.Set(Gf.Vec3d(*step), code)
    stage.Save()
    (item,) = read_shot(stage.GetRootLayer().realPath).grooms
    np.testing.assert_allclose(item.groom.points, curves.GetPointsAttr().Get(), atol=1e-6)


def test_hair_that_only_nearly_keeps_to_the_head_was_made_on_that(tmp_path):
    stage, head = _turned(tmp_path, "mesh")
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    op = curves.AddTransformOp()
    for code in range(START, 10):
        matrix = head[code].copy()
        matrix[0, 3] += 1e-3 * (code % 2)
        op.Set(Gf.Matrix4d(matrix.T.tolist()), code)
    rest = curves.GetPointsAttr().Get()
    stage.Save()
    (item,) = read_shot(stage.GetRootLayer().realPath).grooms
    np.testing.assert_allclose(item.groom.points, rest, atol=2e-3)


def test_hair_made_where_the_character_stands_first_and_hair_off_the_skin(tmp_path):
    stage, _ = _turned(tmp_path, "mesh")
    UsdGeom.Xformable(stage.GetPrimAtPath("/Hero/Hair")).SetResetXformStack(True)
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion")).GetTranslationsAttr()
    for code in range(START, 10):
        motion.Set(Vt.Vec3fArray([v + Gf.Vec3f(0, 0, 3 * (i == 0)) for i, v in enumerate(motion.Get(code))]), code)
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    rest = np.asarray(points.Get())
    stage.Save()
    path = stage.GetRootLayer().realPath
    rig = read_rigs(path)[0]
    head = rig.joints_at(START)[HEAD] @ np.linalg.inv(rig.character.skeleton.bind[HEAD])
    points.Set(_rigid(rest, head))
    stage.Save()
    shot = read_shot(path)
    np.testing.assert_allclose(shot.grooms[0].groom.points, rest, atol=1e-6)
    assert not any("from the skin" in note for note in shot.notes)
    points.Set(Vt.Vec3fArray.FromNumpy((rest + [0, 0.2, 0]).astype(np.float32)))
    stage.Save()
    (said,) = (note for note in read_shot(path).notes if "from the skin" in note)
    assert 0.1 < float(said.split(" m from")[0].split()[-1]) < 0.3


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


@pytest.mark.parametrize("bound", ["mesh", "none"])
def test_hair_made_at_the_shots_first_frame_after_a_run_up(tmp_path, bound):
    """If it was made for a frame in between, a note says so, although its user named it."""
    path = write_shot(tmp_path, Recipe(bound=bound))
    stage = Usd.Stage.Open(str(path))
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion")).GetTranslationsAttr()
    for code in range(1, 10):
        motion.Set(Vt.Vec3fArray([v + Gf.Vec3f(0, 0, code * (i == 0)) for i, v in enumerate(motion.Get(code))]), code)
    stage.SetStartTimeCode(START)
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    rest = np.asarray(points.Get())
    stage.Save()
    (rig,) = read_rigs(path)
    bind = np.linalg.inv(rig.character.skeleton.bind[HEAD])
    points.Set(_rigid(rest, rig.joints_at(START)[HEAD] @ bind))
    stage.Save()
    shot = read_shot(path)
    np.testing.assert_allclose(shot.grooms[0].groom.points, rest, atol=1e-6)
    assert not any("/Hero/Hair: " in note for note in shot.notes)
    points.Set(_rigid(rest, rig.joints_at(START + 2)[HEAD] @ bind))
    stage.Save()
    with pytest.raises(NeuralocksError, match="not taken for hair; if it is, name it with --groom"):
        read_shot(path)
    (said,) = (note for note in read_shot(path, ["/Hero/Hair"]).notes if "/Hero/Hair: " in note)
    assert "m from joint 'head'" in said and "keeps that distance" in said


@pytest.mark.parametrize("written", ["points", "transform"])
def test_hair_that_was_written_at_one_frame_lies_where_it_is_seen_then(tmp_path, written):
    """Exporters write what does not move as a single sample, at the frame that is current."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    (rig,), stage = read_rigs(path), Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    points, rest = curves.GetPointsAttr(), np.asarray(curves.GetPointsAttr().Get())
    head = rig.carrying_at(START)
    if written == "points":
        points.Clear()
        points.Set(_rigid(rest, head), START)
    else:
        curves.AddTransformOp().Set(Gf.Matrix4d(*head.T.ravel().tolist()), START)
    stage.Save()
    (item,) = read_shot(path).grooms
    np.testing.assert_allclose(item.groom.points, rest, atol=1e-6)


@pytest.mark.parametrize("frames", [9, 0], ids=["animated", "still"])
@pytest.mark.parametrize(("degrees", "hovers"), [(4, 0.0), (20, 0.0), (90, 0.0), (20, 0.002)])
def test_hair_made_on_a_character_in_its_rest_pose_is_on_the_head(tmp_path, degrees, hovers, frames):
    """Without its animation, USD shows a character in that pose, which need not be the bind pose."""
    path = write_shot(tmp_path, Recipe(bound="mesh", frames=frames))
    stage = Usd.Stage.Open(str(path))
    rests = UsdSkel.Skeleton(stage.GetPrimAtPath("/Hero/Rig")).GetRestTransformsAttr()
    bent = np.array(rests.Get())
    angle = np.radians(degrees)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), np.sin(angle)], [0, -np.sin(angle), np.cos(angle)]])
    bent[1, :3, :3] = bent[1, :3, :3] @ turn
    rests.Set(Vt.Matrix4dArray.FromNumpy(bent))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    rest = CENTRE + (np.asarray(points.Get()) - CENTRE) * (1 + hovers / 0.1)
    stage.Save()
    (rig,) = read_rigs(path)
    points.Set(_rigid(rest, rig.carrying_at_rest))
    assert np.abs(np.asarray(points.Get()) - rest).max() > 0.02
    stage.Save()
    np.testing.assert_allclose(read_shot(path, still=True).grooms[0].groom.points, rest, atol=2e-6)


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


def test_a_moving_prims_motion_is_measured_alike_often_for_few_and_many_meshes(tmp_path, monkeypatch):
    """Measured per mesh, a crowd that walks by its transforms would take seven times as long to read."""
    stage, head = _turned(tmp_path, "mesh")
    op = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero/Hair")).AddTransformOp()
    for code in range(START, 10):
        op.Set(Gf.Matrix4d((0.5 * (head[code] + np.eye(4))).T.tolist()), code)
    asked, drift = [], ways._drift
    monkeypatch.setattr(ways, "_drift", lambda *given: asked.append(given) or drift(*given))
    counts = []
    for number in range(2):
        stage.Save()
        read_shot(stage.GetRootLayer().realPath)
        counts.append(len(asked))
        Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Skin", stage.GetRootLayer(), f"/Hero/Skin{number}")
    assert counts[1] == 2 * counts[0] > 0


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
