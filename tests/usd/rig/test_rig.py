# SPDX-License-Identifier: Apache-2.0
"""Rigged mesh hair on stages: found in any unit, baked as one SkelAnimation, the body left as it was."""

import subprocess
import sys

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from neuralocks_core.rig import RigModel
from neuralocks_core.rig.network import held_features
from neuralocks_core.rotation import from_vector
from usd.review.evaluate import evaluate
from usd.rig.bake import bake_rig
from usd.rig.stage import BAKED, describe_chains, read_rigged_hair
from usd.shot.stage import read_shot

from ...blenders import installed
from ...full_disk import room_for
from ...shared_data import SHARED
from ..rig_shots import EXAMPLE, hair_turns, model_for, small_shot


def test_the_body_stays_sample_for_sample(tmp_path):
    """Joint order, rotations, translations and blend shapes are the shot's own; only hair rotations differ."""
    shot = small_shot(tmp_path / "shot.usda")
    bake_rig(shot, tmp_path / "out.usda", model_for(read_rigged_hair(shot)))
    stage, own = Usd.Stage.Open(str(tmp_path / "out.usda")), Usd.Stage.Open(str(shot))
    baked = UsdSkel.Animation(stage.GetPrimAtPath(f"/Who/Rig/{BAKED}"))
    before = UsdSkel.Animation(own.GetPrimAtPath("/Who/Motion"))
    assert list(baked.GetJointsAttr().Get()) == list(before.GetJointsAttr().Get())
    assert baked.GetRotationsAttr().GetTimeSamples() == before.GetRotationsAttr().GetTimeSamples()
    assert baked.GetTranslationsAttr().Get() == before.GetTranslationsAttr().Get()
    assert baked.GetScalesAttr().Get() == before.GetScalesAttr().Get()
    assert list(baked.GetBlendShapesAttr().Get()) == ["smile"] and baked.GetBlendShapeWeightsAttr().Get(3)[0] == 0.25
    moved = 0
    for code in baked.GetRotationsAttr().GetTimeSamples():
        new, old = baked.GetRotationsAttr().Get(code), before.GetRotationsAttr().Get(code)
        assert list(new[:2]) == list(old[:2]) and new[5] == old[5]
        moved += list(new[2:5]) != list(old[2:5])
    assert moved > 20
    for attribute in ("bindTransforms", "restTransforms", "joints"):
        pair = [s.GetPrimAtPath("/Who/Rig").GetAttribute(attribute).Get() for s in (stage, own)]
        assert pair[0] == pair[1]
    target = UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Rig")).GetInheritedAnimationSource()
    assert str(target.GetPath()) == f"/Who/Rig/{BAKED}"
    assert stage.GetRootLayer().subLayerPaths[0] == "./shot.usda"


def test_a_channel_keeps_both_its_samples_and_what_it_shows_at_no_time(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    stage = Usd.Stage.Open(str(shot))
    own = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetTranslationsAttr()
    still = own.Get()
    own.Set(Vt.Vec3fArray([still[0] + Gf.Vec3f(0, 1, 0), *still[1:]]), 5)
    stage.GetRootLayer().Save()
    bake_rig(shot, tmp_path / "out.usda", model_for(read_rigged_hair(shot)))
    result = Usd.Stage.Open(str(tmp_path / "out.usda"))
    baked = result.GetAttributeAtPath(f"/Who/Rig/{BAKED}.translations")
    assert baked.Get() == still != baked.Get(5) == own.Get(5)


def test_a_bake_that_does_not_find_the_shots_parts_from_its_own_folder_is_told_so(tmp_path):
    """As for strands, see test_bake_tells.py."""
    for name in ("show", "layout", "cache"):
        (tmp_path / name).mkdir()
    model = model_for(read_rigged_hair(small_shot(tmp_path / "show" / "who.usda")))
    (tmp_path / "layout" / "set.usda").write_text('#usda 1.0\ndef "Who" (references = @who.usda@</Who>)\n{\n}\n')
    shot = tmp_path / "show" / "shot.usda"
    shot.write_text("#usda 1.0\n(\n  metersPerUnit = 1\n  subLayers = [@../layout/set.usda@]\n)\n")
    notes = {name: bake_rig(shot, tmp_path / name / "b.usda", model).notes for name in ("show", "cache")}
    assert not any("who.usda" in note for note in notes["show"])
    assert any("who.usda" in note and "SEARCH_PATH" in note for note in notes["cache"])


def test_units_axes_and_rates_cancel(tmp_path):
    """Centimetres, Z up and 48 fps give the same local turns at shared times."""
    plain = small_shot(tmp_path / "a.usda")
    model = model_for(read_rigged_hair(plain))
    bake_rig(plain, tmp_path / "out_a.usda", model)
    wanted = hair_turns(tmp_path / "out_a.usda", [1, 7, 13, 20])
    for name, options in (("cm", {"scale": 100.0}), ("z", {"z_up": True}), ("both", {"scale": 100.0, "z_up": True})):
        shot = small_shot(tmp_path / f"{name}.usda", **options)
        bake_rig(shot, tmp_path / f"out_{name}.usda", model)
        assert np.abs(hair_turns(tmp_path / f"out_{name}.usda", [1, 7, 13, 20]) - wanted).max() < 1e-5, name
    shot = small_shot(tmp_path / "fast.usda", rate=48, frames=48)
    bake_rig(shot, tmp_path / "out_fast.usda", model)
    assert np.abs(hair_turns(tmp_path / "out_fast.usda", [1, 13, 25, 39]) - wanted).max() < 1e-5


def test_a_scale_keyed_once_is_a_scale(tmp_path):
    """Blender exports the scale of an FBX armature, 0.01, as one time sample without a default value."""
    wanted = describe_chains(read_rigged_hair(small_shot(tmp_path / "plain.usda")).rig.chains)
    stage = Usd.Stage.Open(str(small_shot(tmp_path / "fbx.usda", scale=100.0)))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.Xformable(stage.GetPrimAtPath("/Who")).AddScaleOp().Set(Gf.Vec3f(0.01), 1)
    stage.GetRootLayer().Save()
    assert describe_chains(read_rigged_hair(tmp_path / "fbx.usda").rig.chains) == wanted


def test_ranges_cannot_change_a_sample(tmp_path):
    """The same bytes twice, and the same samples whatever else is asked for; also with a dynamic model."""
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot), dynamic=True)
    for name in ("a", "b"):
        bake_rig(shot, tmp_path / f"{name}.usdc", model)
    assert (tmp_path / "a.usdc").read_bytes() == (tmp_path / "b.usdc").read_bytes()
    bake_rig(shot, tmp_path / "c.usdc", model, frames=[20, 5, 11], subframes=2)
    codes = [5, 11, 20]
    assert (hair_turns(tmp_path / "a.usdc", codes) == hair_turns(tmp_path / "c.usdc", codes)).all()


def test_a_loop_is_seamless(tmp_path):
    """With --loop, the last sample of a dynamic bake equals the first one."""
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot), dynamic=True)
    result = bake_rig(shot, tmp_path / "out.usda", model, loop=True)
    assert not any("loop" in note for note in result.notes)
    first, last = hair_turns(tmp_path / "out.usda", [1, 25])
    assert np.abs(first - last).max() < 2e-4
    assert bake_rig(shot, tmp_path / "blurred.usda", model, loop=True, subframes=3).notes == result.notes
    longer = bake_rig(shot, tmp_path / "longer.usda", model, loop=True, frames="1:60").notes
    assert sum("goes from 1 to 25; outside that range the hair goes on with the loop" in note for note in longer) == 1
    assert not any("held pose" in note for note in longer)
    bake_rig(shot, tmp_path / "open.usda", model)
    first, last = hair_turns(tmp_path / "open.usda", [1, 25])
    assert np.abs(first - last).max() > 1e-3


def test_hair_goes_on_in_a_loop_past_the_clip(tmp_path):
    """The animation has 24 frames; UsdSkel holds its last pose from there on."""
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot), dynamic=True)
    bake_rig(shot, tmp_path / "out.usda", model, loop=True, frames="1:60")
    once, again = (hair_turns(tmp_path / "out.usda", codes) for codes in (range(6, 13), range(30, 37)))
    np.testing.assert_allclose(again, once, atol=1e-5)
    assert np.ptp(once, axis=0).max() > 0.01


def test_hair_starts_anew_after_a_cut(tmp_path):
    """Detected and reported, or given; the frames before it are the same as without it."""
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot), dynamic=True)
    bake_rig(shot, tmp_path / "whole.usda", model)
    stage = Usd.Stage.Open(str(shot))
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion"))
    hips = np.array(motion.GetTranslationsAttr().Get())
    for code in range(1, 26):
        moved = np.vstack([hips[:1] + [3.0 * (code > 12), 0, 0], hips[1:]]).astype(np.float32)
        motion.GetTranslationsAttr().Set(Vt.Vec3fArray.FromNumpy(moved), code)
    stage.GetRootLayer().Save()
    found = bake_rig(shot, tmp_path / "found.usda", model)
    assert any("another place at 13" in note for note in found.notes)
    held = bake_rig(shot, tmp_path / "held.usda", model_for(read_rigged_hair(shot)))
    assert not any("another place" in note for note in held.notes), "held poses have no past"
    given = bake_rig(shot, tmp_path / "given.usda", model, cuts=[13])
    assert not any("another place" in note for note in given.notes)
    assert (tmp_path / "found.usda").read_bytes() == (tmp_path / "given.usda").read_bytes()
    bake_rig(shot, tmp_path / "none.usda", model, cuts=[])
    codes = list(range(1, 26))
    turns = {name: hair_turns(tmp_path / f"{name}.usda", codes) for name in ("whole", "found", "none")}
    assert np.abs(turns["found"] - turns["whole"])[:12].max() < 2e-3
    assert np.abs(turns["none"] - turns["found"])[12:].max() > 0.05
    for options, words in (
        ({"cuts": [99]}, "--cuts 99: lies outside"),
        ({"strength": None}, "--strength None: must be a number from 0 to 2"),
        ({"cuts": [13], "loop": True}, "leave out --loop"),
        ({"loop": "no"}, "--loop 'no': must be True or False"),
    ):
        with pytest.raises(NeuralocksError, match=words):
            bake_rig(shot, tmp_path / "bad.usda", model, **options)


def test_a_full_disk_is_not_a_damaged_shot(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot))
    for name in ("out.usda", "out.usdc"):
        with pytest.raises(NeuralocksError, match=f"{name}: .*(no space|cannot be written)"), room_for(1000):
            bake_rig(shot, tmp_path / name, model)
    assert [path.name for path in tmp_path.iterdir()] == ["shot.usda"]


def test_commands_for_strands_say_what_is_for_joints(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    baked = bake_rig(shot, tmp_path / "rig.usda", model_for(read_rigged_hair(shot), dynamic=True))
    for use in (read_shot, evaluate):
        with pytest.raises(NeuralocksError, match="hair that is joints of /Who/.* is moved by 'neuralocks rig bake'"):
            use(baked.path)


def test_the_example_and_its_command_line(tmp_path):
    """Eight chains of four joints; the baked layer has no validation finding."""
    hair = read_rigged_hair(EXAMPLE / "shot.usda")
    rows = describe_chains(hair.rig.chains)
    assert len(rows) == 8 and all(row["joints"] == 4 and 0.15 < row["length [m]"] < 0.4 for row in rows)
    pytest.importorskip("onnx")
    model = model_for(hair).save(tmp_path / "m.neuralocks")
    command = [sys.executable, "-m", "usd", "rig", "bake", str(EXAMPLE / "shot.usda"), "-o", str(tmp_path / "o.usda")]
    done = subprocess.run([*command, "--model", str(model)], capture_output=True, text=True, cwd=EXAMPLE.parents[1])
    assert done.returncode == 0, done.stderr
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "o.usda"))
    assert [p.name for p in layer.rootPrims] == ["Body"]
    done = subprocess.run(
        [*command, "--model", str(tmp_path / "no.neuralocks")], capture_output=True, text=True, cwd=EXAMPLE.parents[1]
    )
    assert done.returncode == 1 and done.stderr.count("\n") == 1


@pytest.mark.parametrize("path", [None, EXAMPLE / "quasi_static.neuralocks"], ids=["dynamic", "quasi_static"])
def test_no_lock_of_the_shipped_networks_stands_out(path):
    """Whatever the neck does: a lock that stood out, by 86 degrees on average, would be clear of every body and not show in any
    motion error.
    """
    rig = read_rigged_hair(EXAMPLE / "character.usda").rig
    model = RigModel.load(path or model_file.shipped("rig"))
    turns = np.random.default_rng(0).uniform(-1, 1, (200, 2, 3)) * [0.5, 0.7, 0.4]
    neck = np.stack([from_vector(turns[:, 0]), from_vector(turns.sum(axis=1))], axis=1)
    gravity = -neck[:, 1, :, 1]  # for an upright trunk
    quaternions = model.canonical_turns(held_features(model.spec, neck, gravity))
    angles = np.degrees(2 * np.arccos(np.clip(np.abs(quaternions[..., 0]), 0, 1))).mean(axis=0)
    assert quaternions.shape[1] == len(rig.chains) and 5 < angles.max() < 45


def test_a_vrm_avatar_through_blender(tmp_path):
    """Its seven hair chains of one joint and an end are found, as its spring-bone groups name them."""
    avatar = SHARED / "rigged" / "godette.vrm"
    blender = next(iter(installed()), None)
    if not avatar.is_file() or blender is None:
        pytest.skip("needs ../shared/data/rigged/godette.vrm and Blender as a Python module (make blender)")
    script = EXAMPLE.parent / "vrm_to_usd.py"
    command = [str(blender), str(script), str(avatar), "-o", str(tmp_path / "g.usdc")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    hair = read_rigged_hair(tmp_path / "g.usdc")
    named = done.stdout.strip().splitlines()[-1].replace("--chains", "").split()
    assert sorted(hair.rig.chains.names) == sorted(named) and len(named) == 7
    assert len(hair.rig.points) > 50


def test_an_open_stage_sees_what_was_baked_last(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot))
    result = bake_rig(shot, tmp_path / "bake.usda", model)
    stage = Usd.Stage.Open(str(result.path))
    turns = stage.GetAttributeAtPath(f"{result.rigs[0].animation}.rotations")
    before = turns.GetNumTimeSamples()
    bake_rig(shot, result.path, model, subframes=2)
    assert turns.GetNumTimeSamples() > before
