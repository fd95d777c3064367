# SPDX-License-Identifier: Apache-2.0
"""Velocities are those of the points, at frames that are those of the shot."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom

from tests.strand_models import write_random_model
from usd.baking.bake import bake
from usd.shot.stage import read_shot

from ..shots import Recipe, samples, write_shot

NAMES = ("points", "velocities")


def test_velocities_are_those_of_the_points(tmp_path, model):
    shot = write_shot(tmp_path, Recipe(unit=0.01))
    result = bake(shot, tmp_path / "bake.usdc", model)
    at = {code: samples(result.path, "points", at=code).astype(float) for code in range(1, 10)}
    middle = (8 * (at[6] - at[4]) - (at[7] - at[3])) * 24 / 12
    first, second = (-3 * at[1] + 4 * at[2] - at[3]) * 12, (at[3] - at[1]) * 12
    for code, expected in ((5, middle), (1, first), (2, second)):
        assert np.allclose(samples(result.path, "velocities", at=code), expected, atol=5e-3)
    # A half frame to both sides gives nearly the same, in the middle of a smooth motion.
    few = bake(shot, tmp_path / "few.usdc", model, frames=[4.5, 5.5]).path
    near = (samples(few, "points", at=5.5).astype(float) - samples(few, "points", at=4.5)) * 24
    assert np.linalg.norm(near - middle) < 0.1 * np.linalg.norm(near)


@pytest.mark.parametrize("rounded", [2e-5, -2e-5])
def test_velocities_do_not_depend_on_how_the_samples_of_the_animation_were_rounded(tmp_path, model, rounded):
    """They may lie beside the frames, also where the animation begins and ends."""
    shot, shifted = write_shot(tmp_path, Recipe(strands=6)), tmp_path / "rounded.usda"
    layer = Sdf.Layer.CreateNew(str(shifted))
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(shot)))
    for channel in layer.GetPrimAtPath("/Hero/Rig/Motion").attributes:
        values = [
            (code, layer.QueryTimeSample(channel.path, code)) for code in layer.ListTimeSamplesForPath(channel.path)
        ]
        for code, value in values:
            layer.EraseTimeSample(channel.path, code)
            layer.SetTimeSample(channel.path, code + rounded, value)
    layer.startTimeCode, layer.endTimeCode = 1 + rounded, 9 + rounded
    layer.Save()
    exact, beside = (bake(path, path.with_suffix(".usdc"), model) for path in (shot, shifted))
    assert beside.frames == exact.frames == list(range(1, 10))
    for code in exact.frames:
        one, other = (samples(done.path, "velocities", at=code) for done in (exact, beside))
        assert np.abs(one - other).max() < 1e-3


@pytest.mark.parametrize("rate", [1.0, 1000.0])
def test_frames_are_the_shots_where_its_time_codes_are_seconds_or_milliseconds(tmp_path, model, rate):
    shots = [write_shot(tmp_path, Recipe(rate=24, frames=9), "frames"), tmp_path / "counted.usda"]
    stage = Usd.Stage.Open(Usd.Stage.Open(str(shots[0])).Flatten())
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(24)
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


def test_a_bake_without_velocities_hides_those_of_another(tmp_path, model):
    first = bake(write_shot(tmp_path), tmp_path / "first.usdc", model, frames=[4, 5])
    again = bake(first.path, tmp_path / "again.usdc", model, frames=[5], velocities=False, material=["weight=2"])
    stage = Usd.Stage.Open(str(again.path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    assert curves.GetPointsAttr().GetTimeSamples() == [5] and not curves.GetVelocitiesAttr().HasValue()


def test_hair_that_swings_on_after_the_last_sample_has_the_velocities_of_its_points(tmp_path):
    """While the body stands still, and whichever of these frames are baked."""
    shot, model = write_shot(tmp_path), write_random_model(tmp_path / "lively.neuralocks", gain=8.0)
    path = bake(shot, tmp_path / "bake.usdc", model, frames="7:15").path
    at, moving = ({code: samples(path, name, at=code).astype(float) for code in range(7, 16)} for name in NAMES)
    assert np.abs(at[12] - at[11]).max() * 24 > 0.02
    assert np.allclose(moving[9], (3 * at[9] - 4 * at[8] + at[7]) * 12, atol=1e-3)
    assert np.allclose(moving[10], (at[11] - at[9]) * 12, atol=1e-3)
    for code in (11, 12, 13):
        expected = (8 * (at[code + 1] - at[code - 1]) - (at[code + 2] - at[code - 2])) * 24 / 12
        assert np.allclose(moving[code], expected, atol=1e-3)
    few = bake(shot, tmp_path / "few.usdc", model, frames=[9.5, 12, 15]).path
    for code in (12, 15):
        np.testing.assert_array_equal(samples(few, "velocities", at=code), moving[code])
    assert np.abs(samples(few, "velocities", at=9.5)).max() > 0.02


def test_before_the_first_sample_hair_is_at_rest(tmp_path, model):
    path = bake(write_shot(tmp_path), tmp_path / "bake.usdc", model, frames="-2:1").path
    for code in (-2, -1, 0):
        assert not samples(path, "velocities", at=code).any()


@pytest.mark.parametrize("frames", [2, 3])
def test_where_there_is_room_for_one_frame_only_velocities_are_the_way_to_it(tmp_path, model, frames):
    """A clip of two frames, whose last only has the one before it; and half frames next to the ends of a clip of three."""
    shot = write_shot(tmp_path, Recipe(frames=frames))
    path = bake(shot, tmp_path / "bake.usdc", model, frames=f"1:{frames}", subframes=2).path
    at = {code: samples(path, "points", at=code).astype(float) for code in np.arange(1, frames + 0.1, 0.5)}
    for code, low in {2: {1: 1, 2: 1}, 3: {1.5: 1.5, 2.5: 1.5}}[frames].items():
        moving = (at[low + 1] - at[low]) * 24
        assert np.abs(moving).max() > 0.05
        np.testing.assert_allclose(samples(path, "velocities", at=code), moving, atol=1e-3)
