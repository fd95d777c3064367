# SPDX-License-Identifier: Apache-2.0
"""The bake's contract: what it authors, that only shot, model and time matter, and that kills leave no trace."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, UsdValidation

from neuralocks_core.errors import NeuralocksError
from usd.bake import bake
from usd.border import open_stage
from usd.inspect import inspect
from usd.stage import read_shot

from .shots import CENTRE, HEAD, Recipe, strand_points, write_shot

ROOT = Path(__file__).parents[2]


def world_points(path, code, prim="/Hero/Hair"):
    """(P, 3) points of a groom in world space, metres, Y up, as a renderer places them."""
    stage = open_stage(path)
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(prim))
    matrix = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(curves.GetPrim())).T
    points = np.asarray(curves.GetPointsAttr().Get(code), float) @ matrix[:3, :3].T + matrix[:3, 3]
    if UsdGeom.GetStageUpAxis(stage) == "Z":
        points = points @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]).T
    return points * UsdGeom.GetStageMetersPerUnit(stage)


def samples(path, *names, at=None, prim="/Hero/Hair"):
    """Values of the groom's attributes at a time code (default time for None)."""
    stage = open_stage(path)
    code = Usd.TimeCode.Default() if at is None else Usd.TimeCode(at)
    values = [np.asarray(stage.GetPrimAtPath(prim).GetAttribute(name).Get(code)) for name in names]
    return values if len(values) > 1 else values[0]


@pytest.fixture(scope="module")
def baked(tmp_path_factory, model):
    folder = tmp_path_factory.mktemp("bake")
    shot = write_shot(folder)
    return shot, bake(shot, folder / "bake.usdc", model)


def test_the_layer_holds_samples_and_nothing_else(baked):
    shot, result = baked
    layer = Sdf.Layer.FindOrOpen(str(result.path))
    assert list(layer.subLayerPaths) == ["./shot.usda"]
    hair = layer.GetPrimAtPath("/Hero/Hair")
    assert set(hair.properties.keys()) == {"points", "velocities", "extent", "skel:skeleton"}
    assert all(p.specifier == Sdf.SpecifierOver for p in (hair, layer.GetPrimAtPath("/Hero")))
    assert all(hair.attributes[n].default is None for n in ("points", "velocities", "extent"))
    assert layer.ListTimeSamplesForPath("/Hero/Hair.points") == [float(t) for t in range(1, 10)]
    stage, source = Usd.Stage.Open(layer), open_stage(shot)
    for key in (
        "metersPerUnit",
        "upAxis",
        "timeCodesPerSecond",
        "framesPerSecond",
        "defaultPrim",
        "startTimeCode",
        "endTimeCode",
    ):
        assert stage.GetMetadata(key) == source.GetMetadata(key), key
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    for time_code in (1.0, 5.0):
        assert len(curves.GetPointsAttr().Get(time_code)) == sum(curves.GetCurveVertexCountsAttr().Get())
        low, high = np.asarray(curves.GetExtentAttr().Get(time_code))
        points = np.asarray(curves.GetPointsAttr().Get(time_code))
        assert (low <= points.min(0)).all() and (high >= points.max(0)).all()
    rest = UsdGeom.BasisCurves(source.GetPrimAtPath("/Hero/Hair")).GetPointsAttr().Get()
    assert np.array_equal(curves.GetPointsAttr().Get(), rest)


def test_validators_find_nothing(baked, tmp_path, model):
    mesh = bake(write_shot(tmp_path, Recipe(bound="mesh", unit=0.01, up="Z")), tmp_path / "mesh.usda", model)
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    for path in (baked[1].path, mesh.path):
        assert [f"{e.GetName()}: {e.GetMessage()}" for e in context.Validate(Usd.Stage.Open(str(path)))] == []


def test_usd_skel_leaves_baked_hair_alone(baked):
    stage = Usd.Stage.Open(str(baked[1].path))
    root, cache = UsdSkel.Root(stage.GetPrimAtPath("/Hero")), UsdSkel.Cache()
    cache.Populate(root, Usd.PrimDefaultPredicate)
    skinned = [
        str(query.GetPrim().GetPath())
        for binding in cache.ComputeSkelBindings(root, Usd.PrimDefaultPredicate)
        for query in binding.GetSkinningTargets()
    ]
    assert skinned == ["/Hero/Skin"]


def test_hair_that_the_network_leaves_still_follows_the_skin_as_usd_skel_does(tmp_path, still_model):
    shot = write_shot(tmp_path)
    result = bake(shot, tmp_path / "still.usdc", still_model)
    stage = open_stage(shot)
    skeleton = UsdSkel.Cache()
    skeleton.Populate(UsdSkel.Root(stage.GetPrimAtPath("/Hero")), Usd.PrimDefaultPredicate)
    query = skeleton.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/Hero/Rig")))
    rest = strand_points(40, 12).reshape(-1, 3)
    for code in (1.0, 4.0, 7.5):
        matrix = np.array(query.ComputeSkinningTransforms(code)[HEAD]).T
        expected = rest @ matrix[:3, :3].T + matrix[:3, 3]
        frames = bake(shot, tmp_path / "one.usdc", still_model, frames=[code]) if code % 1 else result
        assert np.abs(world_points(frames.path, code) - expected).max() < 2e-6
    # In the bind pose the author's own bits come back.
    assert np.array_equal(samples(result.path, "points", at=1.0), samples(shot, "points"))


@pytest.mark.parametrize(
    "recipe",
    [
        Recipe(unit=0.01),
        Recipe(up="Z"),
        Recipe(unit=0.01, up="Z", bound="mesh"),
        Recipe(unit=0.0254, nesting="/World/Set/Hero", bound="mesh"),
        Recipe(unit=0.01, bound="none"),
        Recipe(skel_root=False, basis="bspline"),
    ],
    ids=["cm", "z_up", "cm_z_up_on_mesh", "inch_nested", "cm_by_name", "no_skel_root_cubic"],
)
def test_units_axes_and_nesting_do_not_matter(baked, tmp_path, model, recipe):
    result = bake(write_shot(tmp_path, recipe), tmp_path / "bake.usdc", model)
    for code in (1.0, 6.0):
        here = world_points(result.path, code, f"{recipe.nesting}/Hair")
        # Without skin the head's centre is an average one, which the network's inputs feel.
        tolerance = 2e-2 if recipe.bound == "none" else 5e-5
        assert np.abs(here - world_points(baked[1].path, code)).max() < tolerance


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_placed_and_scaled_character_moves_as_it_would_in_place(baked, tmp_path, model, scale):
    turn = np.eye(4)
    turn[:3, :3] = scale * np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    turn[:3, 3] = 5, 0, -3
    recipe = Recipe(place=turn, bound="mesh")
    # A character a hundredth of the size is scaled up again by its unit, as in files exported from centimetres.
    shot = write_shot(tmp_path, recipe)
    if scale != 1.0:
        stage = Usd.Stage.Open(str(shot))
        UsdGeom.SetStageMetersPerUnit(stage, 1 / scale)
        stage.GetRootLayer().Save()
    result = bake(shot, tmp_path / "bake.usdc", model)
    for code in (1.0, 6.0):
        here = world_points(result.path, code) - turn[:3, 3] / scale
        back = here @ (turn[:3, :3] / scale)
        assert np.abs(back - world_points(baked[1].path, code)).max() < 1e-4


def test_a_moving_root_moves_the_hair_and_its_history(tmp_path, model):
    shots = []
    for name, moving in (("still", False), ("moved", True)):
        path = write_shot(tmp_path, Recipe(bound="mesh"), name)
        stage = Usd.Stage.Open(str(path))
        op = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddTranslateOp()
        for frame in range(1, 10):
            op.Set((0.02 * (frame - 1) ** 2 if moving else 0.0, 0, 0), frame)
        stage.GetRootLayer().Save()
        shots.append(bake(path, tmp_path / f"{name}.usdc", model).path)
    shift = world_points(shots[1], 9.0) - world_points(shots[0], 9.0)
    assert np.abs(np.median(shift[:, 0]) - 0.02 * 64) < 0.05
    assert np.ptp(shift, axis=0).max() > 1e-3  # acceleration changes the hair, not only its place


def test_velocities_are_those_of_the_points(tmp_path, model):
    shot = write_shot(tmp_path, Recipe(unit=0.01))
    result = bake(shot, tmp_path / "bake.usdc", model)
    at = {code: samples(result.path, "points", at=code).astype(float) for code in range(1, 10)}
    middle = (8 * (at[6] - at[4]) - (at[7] - at[3])) * 24 / 12
    first, second = (-3 * at[1] + 4 * at[2] - at[3]) * 12, (at[3] - at[1]) * 12
    for code, expected in ((5, middle), (1, first), (2, second)):
        assert np.allclose(samples(result.path, "velocities", at=code), expected, atol=5e-3)
    # A half frame to both sides says nearly the same, in the middle of a smooth motion.
    few = bake(shot, tmp_path / "few.usdc", model, frames=[4.5, 5.5]).path
    near = (samples(few, "points", at=5.5).astype(float) - samples(few, "points", at=4.5)) * 24
    assert np.linalg.norm(near - middle) < 0.1 * np.linalg.norm(near)


@pytest.mark.parametrize("rate", [1.0, 1000.0])
def test_frames_are_the_shots_where_its_time_codes_are_seconds_or_milliseconds(tmp_path, model, rate):
    shots = [write_shot(tmp_path, Recipe(rate=24, frames=9), "frames"), tmp_path / "counted.usda"]
    stage = Usd.Stage.Open(Usd.Stage.Open(str(shots[0])).Flatten())
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate if rate > 24 else 24)
    stage.SetStartTimeCode(rate / 24)
    stage.SetEndTimeCode(9 * rate / 24)
    motion = stage.GetPrimAtPath("/Hero/Rig/Motion")
    for attribute in motion.GetAttributes():
        values = {code: attribute.Get(code) for code in attribute.GetTimeSamples()}
        if values:
            attribute.Clear()
        for code, value in values.items():
            attribute.Set(value, code * rate / 24)
    stage.GetRootLayer().Export(str(shots[1]))
    read = [read_shot(shot).rigs[0].clip for shot in shots]
    assert len(read[1].times) == 9 and np.allclose(read[0].times, read[1].times)
    assert np.abs(read[0].joints - read[1].joints).max() < 1e-6
    bakes = [bake(shot, shot.with_suffix(".usdc"), model, subframes=2) for shot in shots]
    assert np.allclose(np.array(bakes[1].frames) * 24 / rate, bakes[0].frames)
    for code, seconds in zip(bakes[0].frames, bakes[1].frames, strict=True):
        frames, counted = (
            samples(done.path, "points", "velocities", at=at) for done, at in zip(bakes, (code, seconds))
        )
        assert np.abs(frames[0] - counted[0]).max() < 1e-5
        assert np.abs(frames[1] - counted[1]).max() < 1e-3 * np.abs(frames[1]).max() + 1e-5


def test_order_chunks_and_jobs_give_the_same_bytes(tmp_path, model):
    shot = write_shot(tmp_path, Recipe(strands=1500, vertices=9))
    whole = bake(shot, tmp_path / "bake.usdc", model, jobs=2, subframes=2).path.read_bytes()
    again = bake(shot, tmp_path / "bake.usdc", model, jobs=1, subframes=2).path.read_bytes()
    codes = [t + s for t in range(1, 10) for s in (0, 0.5)]
    np.random.default_rng(0).shuffle(codes)
    shuffled = bake(shot, tmp_path / "bake.usdc", model, frames=codes).path.read_bytes()
    assert whole == again == shuffled
    part = bake(shot, tmp_path / "part.usdc", model, frames="4:6")
    for code in (4.0, 5.0, 6.0):
        one, other = (
            samples(p, "points", "velocities", "extent", at=code) for p in (tmp_path / "bake.usdc", part.path)
        )
        assert [a.tobytes() for a in one] == [a.tobytes() for a in other]


def test_large_grooms_are_written_in_blocks_that_leave_no_trace(tmp_path, model, monkeypatch):
    shot = write_shot(tmp_path, Recipe(strands=60, vertices=9))
    whole = bake(shot, tmp_path / "bake.usdc", model).path.read_bytes()
    monkeypatch.setattr("usd.samples.BLOCK", 100)
    assert bake(shot, tmp_path / "bake.usdc", model).path.read_bytes() == whole


def test_a_killed_bake_leaves_nothing_and_goes_on(tmp_path, model):
    shot = write_shot(tmp_path, Recipe(frames=30, strands=2000, vertices=16))
    out = tmp_path / "bake.usdc"
    whole = bake(shot, out, model).path.read_bytes()
    out.unlink()
    command = [sys.executable, "-m", "usd", "bake", str(shot), "-o", str(out), "--model", str(model)]
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
    spool = tmp_path / ".bake.usdc.baking"
    while len(list(spool.glob("*.frame"))) < 3 and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not out.exists() and spool.exists(), "the bake was over before it could be killed"
    result = bake(shot, out, model)
    assert result.resumed >= 3
    assert out.read_bytes() == whole
    assert {p.name for p in tmp_path.iterdir()} == {"shot.usda", "bake.usdc"}


def test_frames_of_other_inputs_are_not_taken_over(tmp_path, model, still_model):
    shot, out = write_shot(tmp_path), tmp_path / "bake.usdc"

    def stop(done, total, message):
        if done == 4:
            raise KeyboardInterrupt

    for again, taken in ((model, 4), (still_model, 0)):
        with pytest.raises(KeyboardInterrupt):
            bake(shot, out, model, progress=stop)
        assert not out.exists()
        assert abs(bake(shot, out, again).resumed - taken) <= 1
        out.unlink()


def test_frames_of_another_version_of_the_program_are_not_taken_over(tmp_path, model, monkeypatch):
    shot, out, own = write_shot(tmp_path), tmp_path / "bake.usdc", tmp_path / "posing.py"

    def stop(done, total, message):
        if done == 4:
            raise KeyboardInterrupt

    own.write_text("one")
    monkeypatch.setattr("usd.samples.program_files", lambda: [own])
    with pytest.raises(KeyboardInterrupt):
        bake(shot, out, model, progress=stop)
    own.write_text("another")
    assert bake(shot, out, model).resumed == 0


def test_frames_without_animation_are_said(tmp_path, still_model):
    """A shot at 1001 whose animation stayed at 1: nothing is wrong with any file, and nothing moves."""
    shot = write_shot(tmp_path)
    assert not any("held pose" in note for note in bake(shot, tmp_path / "a.usdc", still_model, frames="9:20").notes)
    assert any("1 to 9" in note for note in bake(shot, tmp_path / "b.usdc", still_model, frames="1001:1003").notes)
    stage = Usd.Stage.Open(str(shot))
    stage.SetStartTimeCode(1001)
    stage.SetEndTimeCode(1048)
    stage.GetRootLayer().Save()
    assert any("layer offsets" in note for note in inspect(shot)["spoils"])


def test_material_and_strength_reach_the_network(tmp_path, model):
    shot = write_shot(tmp_path)
    plain = world_points(bake(shot, tmp_path / "a.usdc", model, frames=[6]).path, 6.0)
    stiff = world_points(bake(shot, tmp_path / "b.usdc", model, frames=[6], material=["bend=5x"]).path, 6.0)
    held = world_points(bake(shot, tmp_path / "c.usdc", model, frames=[6], strength=0).path, 6.0)
    assert np.abs(stiff - plain).max() > 1e-4 and np.abs(held - plain).max() > 1e-4


def test_a_bake_of_a_bake_is_the_bake(baked, tmp_path, model):
    again = bake(baked[1].path, tmp_path / "again.usdc", model, frames=[5])
    assert np.abs(world_points(again.path, 5.0) - world_points(baked[1].path, 5.0)).max() < 1e-6


def test_a_bake_without_velocities_hides_those_of_another(tmp_path, model):
    first = bake(write_shot(tmp_path), tmp_path / "first.usdc", model, frames=[4, 5])
    again = bake(first.path, tmp_path / "again.usdc", model, frames=[5], velocities=False, material=["weight=2"])
    stage = Usd.Stage.Open(str(again.path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    assert curves.GetPointsAttr().GetTimeSamples() == [5] and not curves.GetVelocitiesAttr().HasValue()


def test_a_groom_inside_an_instance_is_baked(tmp_path, model):
    write_shot(tmp_path, name="asset")
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, "Y")
    for name in ("A", "B"):
        prim = stage.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference("./asset.usda")
        prim.SetInstanceable(True)
    stage.SetDefaultPrim(stage.GetPrimAtPath("/A"))
    stage.GetRootLayer().Save()
    result = bake(tmp_path / "shot.usda", tmp_path / "bake.usdc", model, frames=[3])
    assert [g["path"] for g in result.grooms] == ["/A/Hair", "/B/Hair"]
    assert np.array_equal(world_points(result.path, 3.0, "/A/Hair"), world_points(result.path, 3.0, "/B/Hair"))


def test_other_values_than_a_cores_own_are_refused(tmp_path, model):
    shot = write_shot(tmp_path)
    with pytest.raises(NeuralocksError, match="part of the shot"):
        bake(shot, shot, model)
    read = read_shot(shot)
    assert np.abs(read.grooms[0].groom.points.mean(0) - CENTRE).max() < 0.2
    assert os.listdir(tmp_path) == ["shot.usda"]
