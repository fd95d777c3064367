# SPDX-License-Identifier: Apache-2.0
"""Where curves without a binding are in the bind pose, in scenes where no frame shows the bind pose."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.review.baked import read_baked
from usd.shot.carriers import ways
from usd.shot.stage import read_rigs, read_shot

from ..shots import CENTRE, HEAD, Recipe, write_shot

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
