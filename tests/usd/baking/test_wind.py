# SPDX-License-Identifier: Apache-2.0
"""Bakes in a wind: in the stage's axes, recorded, and the same by every way."""

import json

import numpy as np
import pytest
from pxr import Gf, Sdf

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.errors import NeuralocksError
from tests.strand_models import write_random_model
from usd.baking.bake import bake
from usd.baking.join import join
from usd.baking.simulate import simulate
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect
from usd.review.picture import preview
from usd.rig.bake import bake_rig
from usd.rig.evaluate import evaluate_rig
from usd.rig.stage import read_rigged_hair
from usd.shot.bakes.bake_record import KEY

from ..commands import status
from ..rig_shots import EXAMPLE, hair_turns, model_for, small_shot
from ..shots import HAIR, Recipe, samples, world_points, write_loop, write_shot


def test_wind_is_given_in_the_axes_of_the_stage(tmp_path, model):
    """Towards -Y and up of a stage in centimetres with Z up is towards +Z and up with Y up."""
    one = write_shot(tmp_path, Recipe(), "metres")
    other = write_shot(tmp_path, Recipe(unit=0.01, up="Z"), "centimetres")
    bake(one, tmp_path / "one.usdc", model, wind=Gf.Vec3f(2, 4, 6))
    bake(other, tmp_path / "other.usdc", model, wind=(2, -6, 4))
    for code in (1.0, 5.0, 9.0):
        assert world_points(tmp_path / "one.usdc", code) == pytest.approx(
            world_points(tmp_path / "other.usdc", code), abs=2e-5
        )
    calm = bake(one, tmp_path / "calm.usdc", model).path
    assert np.abs(world_points(calm, 5.0) - world_points(tmp_path / "one.usdc", 5.0)).max() > 5e-4


def test_a_frame_does_not_depend_on_the_others_and_parts_make_the_whole(tmp_path, model):
    shot = write_shot(tmp_path)
    whole = bake(shot, tmp_path / "whole.usdc", model, wind=(0, 0, -4), gusts=1).path
    parts = [
        bake(shot, tmp_path / f"{frames[0]}.usdc", model, frames=frames, wind=(0, 0, -4), gusts=1, jobs=1).path
        for frames in ("1:4", "5:9")
    ]
    joined = join(parts, tmp_path / "joined.usdc").path
    assert joined.read_bytes() == whole.read_bytes()
    calm = bake(shot, tmp_path / "calm.usdc", model, frames="5:9").path
    with pytest.raises(NeuralocksError, match="wind"):
        join([parts[0], calm], tmp_path / "mixed.usdc")


@pytest.mark.parametrize("how", [bake, simulate])
def test_gusts_move_hair_before_the_animation_and_its_velocities_say_so(tmp_path, how):
    """In the frames before it, which a shot may render too, the body stands still and the wind goes on."""
    if how is simulate:
        pytest.importorskip("warp", reason="the extra 'train' is not installed")
    given = {"model": write_random_model(tmp_path / "lively.neuralocks", gain=8.0)} if how is bake else {"strands": 20}
    wind = {"wind": (4, 0, -4), "gusts": 1}
    done = how(write_shot(tmp_path), tmp_path / "early.usdc", frames="-12:0", **wind, **given).path
    at = {code: samples(done, "points", at=code).astype(float) for code in range(-12, 1)}
    central = (8 * (at[-4] - at[-6]) - (at[-3] - at[-7])) * 24 / 12
    velocities = samples(done, "velocities", at=-5)
    assert np.abs(central).max() > 1e-3
    assert np.allclose(velocities, central, atol=1e-3 + 0.02 * np.abs(central).max())
    later = how(write_shot(tmp_path), tmp_path / "later.usdc", frames="3:4", **wind, **given).path
    both = how(write_shot(tmp_path), tmp_path / "both.usdc", frames="-2:4", **wind, **given).path
    assert np.array_equal(samples(later, "velocities", at=4), samples(both, "velocities", at=4))


def test_the_command_bakes_what_the_call_bakes(tmp_path, model, capsys):
    shot = write_shot(tmp_path)
    words = ["bake", shot, "-o", tmp_path / "told.usdc", "--model", model, "--wind", "-2,0,1.5", "--gusts", "0.3"]
    assert status(*words) == 0
    called = bake(shot, tmp_path / "called.usdc", model, wind=(-2, 0, 1.5), gusts=0.3).path
    assert samples(called, "points", at=7.0).tobytes() == samples(tmp_path / "told.usdc", "points", at=7.0).tobytes()
    for wrong, said in (
        (["--wind", "2,0"], "--wind 2,0: is not X,Y,Z; write for example 2,0,0"),
        (["--wind", "2,0,x"], "--wind 2,0,x: is not X,Y,Z"),
        (["--wind", "9,0,0"], "wind: is 9 m/s^2 strong; give at most 8"),
        (["--wind", "1e308,1e308,0"], "m/s^2 strong; give at most 8"),
        (["--wind", "nan,0,0"], "wind: (nan, 0.0, 0.0) is not a vector"),
        (["--gusts", "0.5"], "--gusts 0.5: there is no wind that could vary; give --wind X,Y,Z, too"),
        (["--wind", "1,0,0", "--gusts", "2"], "--gusts 2.0: must be a number from 0 to 1"),
    ):
        capsys.readouterr()
        assert status("bake", shot, "-o", tmp_path / "no.usdc", "--model", model, *wrong) == 1
        assert said in capsys.readouterr().err
    assert not (tmp_path / "no.usdc").exists()


def test_a_calm_is_a_bake_without_wind(tmp_path, model):
    shot = write_shot(tmp_path)
    for name, given in (("none", {}), ("calm", {"wind": (0, 0, 0)})):
        bake(shot, tmp_path / f"{name}.usda", model, **given)
    assert (tmp_path / "none.usda").read_bytes() == (tmp_path / "calm.usda").read_bytes()


@pytest.mark.parametrize("wrong", ["2,0,0", (1, 2), (1, 2, "3"), {"x": 1}, 2.0])
def test_what_is_no_wind_is_refused(tmp_path, model, wrong):
    with pytest.raises(NeuralocksError, match="--gusts 'strong': must be a number from 0 to 1"):
        bake(write_shot(tmp_path), tmp_path / "out.usdc", model, wind=(1, 0, 0), gusts="strong")
    with pytest.raises(NeuralocksError, match="wind: .* is not one; give three numbers"):
        bake(write_shot(tmp_path), tmp_path / "out.usdc", model, wind=wrong)


def test_a_bake_records_its_wind_and_a_report_compares_with_the_same(tmp_path):
    """A simulation in a wind, measured against the reference, is the reference; measured in a calm, it is not."""
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    shot = write_shot(tmp_path, Recipe(unit=0.01, up="Z", strands=10, bound="mesh", frames=12))
    out = simulate(shot, tmp_path / "blown.usda", strands=10, wind=(0, -5, 2), gusts=0.8).path
    told = next(each for each in inspect(out)["grooms"] if each["path"] == HAIR)["baked with"]
    assert tuple(told["wind"]) == (0, -5, 2) and told["gusts"] == pytest.approx(0.8)
    assert evaluate(out, reference=True).compared[HAIR]["bake"]["position_percent"] < 0.15
    for number, (key, value) in enumerate((("upAxis", "Y"), ("metersPerUnit", 1.0), ("offset", -20.0))):
        above = Sdf.Layer.CreateNew(str(tmp_path / f"above_{number}.usda"))
        stated = {"upAxis": "Z", "metersPerUnit": 0.01} | {key: value}
        for name in ("upAxis", "metersPerUnit"):
            above.pseudoRoot.SetInfo(name, stated[name])
        above.timeCodesPerSecond = 24
        above.subLayerPaths.append(str(out))
        above.subLayerOffsets[0] = Sdf.LayerOffset(stated.get("offset", 0.0))
        above.Save()
        assert evaluate(above.realPath).grooms
        with pytest.raises(NeuralocksError, match=f"{HAIR}: was baked in a wind, and .*; compare the bake's own file"):
            evaluate(above.realPath, reference=True)
    layer = Sdf.Layer.FindOrOpen(str(out))
    facts = dict(layer.GetPrimAtPath(HAIR).customData[KEY])
    del facts["wind"], facts["gusts"]
    layer.GetPrimAtPath(HAIR).SetInfo("customData", {KEY: facts})
    layer.Save()
    assert evaluate(out, reference=True).compared[HAIR]["bake"]["position_percent"] > 3
    layer.GetPrimAtPath(HAIR).SetInfo("customData", {KEY: facts | {"wind": Gf.Vec3d(99, 0, 0)}})
    layer.Save()
    with pytest.raises(NeuralocksError, match="records a wind that cannot be read .*strong.*; bake again"):
        evaluate(out, reference=True)


def test_a_loop_ends_in_the_wind_that_it_begins_in(tmp_path, model):
    shot = write_loop(tmp_path)
    out = bake(shot, tmp_path / "loop.usdc", model, wind=(3, 0, 0), gusts=1, loop=True).path
    codes = sorted(Sdf.Layer.FindOrOpen(str(out)).ListTimeSamplesForPath(f"{HAIR}.points"))
    first, second, last = (world_points(out, code) for code in (codes[0], codes[1], codes[-1]))
    assert last == pytest.approx(first, abs=1e-5)
    assert np.abs(second - first).max() > 1e-4


def test_wind_moves_the_hair_of_a_character_without_an_animation(tmp_path, model):
    """As on a bust; its bake can be measured and drawn like others."""
    shot, out = write_shot(tmp_path, Recipe(frames=0)), tmp_path / "blown.usdc"
    with pytest.raises(NeuralocksError, match=r"no animation; bind .*, or let a wind blow \(--wind X,Y,Z\)"):
        bake(shot, out, model, frames="1:9")
    with pytest.raises(NeuralocksError, match="neither an animation nor a range of frames; .*--frames FIRST:LAST"):
        bake(shot, out, model, wind=(3, 0, 0))
    assert not out.exists()
    result = bake(shot, out, model, frames="1:9", wind=(6, 0, 0), gusts=1, loop=True)
    assert [note for note in result.notes if "gusts do not repeat" in note]
    assert len(result.frames) == 9
    assert np.abs(np.diff([world_points(out, code) for code in (1.0, 5.0, 9.0)], axis=0)).max() > 1e-5
    assert evaluate(out).grooms[HAIR]["stretch_percent"] < 0.01
    assert preview(out, tmp_path / "blown.png", size=(60, 80)).exists()
    assert inspect(shot)["stops"] and not inspect(out)["stops"]


def test_velocities_of_hair_that_only_a_wind_moves_are_those_of_its_points_in_every_frame(tmp_path):
    """Time code 0, at which a character without an animation is read, is a frame like any other."""
    shot, model = write_shot(tmp_path, Recipe(frames=0)), write_random_model(tmp_path / "lively.neuralocks", gain=8.0)
    out = bake(shot, tmp_path / "blown.usdc", model, frames="-3:3", wind=(4, 0, -4), gusts=1).path
    at = {code: samples(out, "points", at=code).astype(float) for code in range(-3, 4)}
    for code in (-1, 0, 1):
        central = (8 * (at[code + 1] - at[code - 1]) - (at[code + 2] - at[code - 2])) * 24 / 12
        assert np.abs(central).max() > 1e-3
        assert np.allclose(samples(out, "velocities", at=code), central, atol=1e-4)


def test_hair_that_feels_no_wind_refuses_it(tmp_path):
    still = write_random_model(tmp_path / "held.neuralocks", gain=1.0, spec=BoundarySpec(bins=()))
    with pytest.raises(NeuralocksError, match="wind: this model is for held poses"):
        bake(write_shot(tmp_path), tmp_path / "out.usdc", still, wind=(1, 0, 0))
    assert not (tmp_path / "out.usdc").exists()


def test_wind_moves_bones_in_the_axes_of_the_stage(tmp_path, capsys):
    """And neither the body nor a network for held poses."""
    one, other = small_shot(tmp_path / "one.usda"), small_shot(tmp_path / "other.usda", scale=100.0, z_up=True)
    model = model_for(read_rigged_hair(one), dynamic=True)
    path = model.save(tmp_path / "rig.neuralocks")
    codes = [1.0, 9.0, 17.0]
    bake_rig(one, tmp_path / "a.usda", model, wind=(3, 0, 6))
    bake_rig(other, tmp_path / "b.usda", model, wind=(3, -6, 0))
    bake_rig(one, tmp_path / "calm.usda", model)
    blown, calm = (hair_turns(tmp_path / f"{name}.usda", codes) for name in ("a", "calm"))
    assert hair_turns(tmp_path / "b.usda", codes) == pytest.approx(blown, abs=2e-3)
    assert np.abs(blown - calm).max() > 1e-2
    words = ["rig", "bake", one, "-o", tmp_path / "told.usda", "--model", path, "--wind", "3,0,6", "--json"]
    assert status(*words) == 0 and json.loads(capsys.readouterr().out)
    assert hair_turns(tmp_path / "told.usda", codes).tolist() == blown.tolist()
    with pytest.raises(NeuralocksError, match="wind: this model is for held poses"):
        bake_rig(one, tmp_path / "no.usda", model_for(read_rigged_hair(one)), wind=(1, 0, 0))
    assert not (tmp_path / "no.usda").exists()


def test_wind_moves_the_hair_of_a_head_that_is_held_still(tmp_path):
    shot = small_shot(tmp_path / "still.usda", head_moves=False)
    model = model_for(read_rigged_hair(shot), dynamic=True)
    with pytest.raises(NeuralocksError, match="is not animated, so the hair would not move"):
        bake_rig(shot, tmp_path / "calm.usda", model)
    notes = bake_rig(shot, tmp_path / "blown.usda", model, wind=(0, 0, -5), gusts=1).notes
    assert not any("held pose" in note for note in notes)
    assert np.abs(np.diff(hair_turns(tmp_path / "blown.usda", [1.0, 9.0, 17.0]), axis=0)).max() > 1e-3


def test_a_rig_bake_of_a_character_without_an_animation_is_told_its_frames(tmp_path):
    """It wrote one frame, without a word."""
    shot = EXAMPLE / "character.usda"
    with pytest.raises(NeuralocksError, match="/Body/Rig: has neither an animation nor .*--frames FIRST:LAST"):
        bake_rig(shot, tmp_path / "out.usda", wind=(3, 0, 0))
    assert bake_rig(shot, tmp_path / "out.usda", wind=(3, 0, 0), frames="1:5").rigs[0].samples == 5


def test_a_rig_bake_records_its_wind_and_a_report_calls_no_gust_jitter(tmp_path):
    shot, out = small_shot(tmp_path / "still.usda", head_moves=False), tmp_path / "blown.usda"
    model = model_for(read_rigged_hair(shot), dynamic=True)
    for gusts in (1.0, 0.0):
        bake_rig(shot, out, model, wind=(0, 0, -5), gusts=gusts, frames="1:96")
        (told,) = inspect(out)["skeletons"]
        assert told["baked with"] == {"strength": 1.0, "loop": False, "wind": [0, 0, -5], "gusts": gusts}
        jitter = evaluate_rig(out).measures["jitter_mm"]
        assert np.isnan(jitter) if gusts else jitter < 0.01
