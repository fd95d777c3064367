# SPDX-License-Identifier: Apache-2.0
"""The motion of a skeleton as it is read: its times, where its samples come from, and whether it is a loop."""

from dataclasses import replace

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import from_vector
from usd.border.time_codes import time_codes
from usd.shot.notes.range_notes import out_of_range
from usd.shot.stage import read_rigs, read_shot
from usd.skel.source import find_skeletons

from ..shots import Recipe, write_loop, write_shot


def test_a_rate_of_its_own_gives_seconds_of_its_own(tmp_path):
    shot = read_shot(write_shot(tmp_path, Recipe(rate=30, frames=31)))
    assert np.isclose(shot.rigs[0].clip.end - shot.rigs[0].clip.start, 1.0)


def test_motion_does_not_depend_on_the_rate_of_the_stage_that_it_comes_to(tmp_path):
    """A layer with 24 frames per second in a shot with 60, its first frame between two of the shot's."""
    motion = write_shot(tmp_path, Recipe(frames=9), "motion")
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.SetTimeCodesPerSecond(60)
    stage.GetRootLayer().subLayerPaths.append("./motion.usda")
    stage.GetRootLayer().subLayerOffsets[0] = Sdf.LayerOffset(0.3)
    stage.GetRootLayer().Save()
    own, seen = (read_rigs(path)[0].clip for path in (motion, tmp_path / "shot.usda"))
    assert np.allclose(seen.times - seen.start, own.times - own.start)
    # Distant keys are joined by straight lines, as in renderers.
    for attribute in stage.GetPrimAtPath("/Hero/Rig/Motion").GetAttributes():
        stage.SetEditTarget(stage.GetRootLayer())
        values = {code: attribute.Get(code) for code in attribute.GetTimeSamples()[::4]}
        for code, value in values.items():
            attribute.Set(value, code)
    stage.GetRootLayer().Save()
    assert len(read_rigs(tmp_path / "shot.usda")[0].clip.times) == 3 + 20


@pytest.mark.parametrize("off", [1e-14, 1e-10, 1e-5, -1e-10])
def test_samples_a_rounding_error_apart_are_one(tmp_path, off):
    """As layer offsets and clocks in single precision leave them: over so little time, any difference is a blow."""
    shot = write_shot(tmp_path, Recipe(frames=24))
    one = read_rigs(shot)[0]
    stage = Usd.Stage.Open(str(shot))
    top = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddTranslateOp()
    for code in range(1, 25):
        top.Set(Gf.Vec3d(0, 1e-7 * (code % 2), 0), code + off)
    stage.Save()
    apart = read_rigs(shot)[0]
    assert len(apart.time_codes) == len(one.time_codes) and not len(apart.clip.cuts)
    vectors = [StrandModel.load().sampler(rig.character, rig.clip).vectors([0.7])[0] for rig in (one, apart)]
    np.testing.assert_allclose(vectors[1], vectors[0], atol=0.02 * np.abs(vectors[0]).max())


def test_a_loop_that_does_not_close_is_said(tmp_path):
    rig = read_shot(write_shot(tmp_path)).rigs[0]
    closed = replace(rig, clip=Clip(rig.clip.times[:3], rig.clip.joints[[0, 1, 0]]))
    assert not closed.loop_notes()
    assert not closed.loop_notes(time_codes("1:9", 1, 9, subframes=64)), "one round, with the last frame's own samples"
    for frames in ("0:9", "1:10"):
        (note,) = closed.loop_notes(time_codes(frames, 1, 9))
        assert "goes from 1 to 9" in note
    for rounded in (-2e-5, 2e-5):
        beside = replace(closed, time_codes=closed.time_codes + rounded)
        assert [len(beside.loop_notes(time_codes(frames, 1, 9))) for frames in ("1:9", "0:9", "1:10")] == [0, 1, 1]
    (note,) = rig.loop_notes()
    assert "/Hero/Rig" in note and "time codes 1 and 9" in note
    turned = rig.clip.joints[[0, 0]]
    turned[1] = np.block([[from_vector(np.array([0, 1.0, 0])), np.zeros((3, 1))], [np.zeros(3), 1]]) @ turned[0]
    turned[1, -1, :3, :3] = from_vector(np.array([0, 1e-4, 0])) @ turned[1, -1, :3, :3]
    (note,) = replace(rig, clip=Clip(rig.clip.times[:2], turned)).loop_notes()
    assert f"joint '{rig.joints.names[0]}' is turned by 57 degrees" in note  # all joints are, with it
    assert not replace(rig, clip=Clip(rig.clip.times[:2], turned)).loop_notes(replaced=[0])  # which carries all others
    turned[:, -1, :3, :3] = 0  # a joint that hides its children
    (note,) = replace(rig, clip=Clip(rig.clip.times[:2], turned)).loop_notes()
    assert f"joint '{rig.joints.names[0]}' is turned by 57 degrees" in note


def test_a_loop_ends_with_its_last_sample_whatever_rounded_the_range_of_its_shot(tmp_path):
    shot = write_loop(tmp_path)
    stage = Usd.Stage.Open(str(shot))
    stage.SetEndTimeCode(13.00002)
    stage.Save()
    rig = read_rigs(shot)[0]
    assert len(rig.cycle.times) == 13 and rig.cycle.times[-1] == pytest.approx(13 / 24, abs=1e-5)
    assert not rig.loop_notes()


CURVE = ((1, 0.0), (5, 80.0), (9, 20.0))


def _spline(ts):
    spline = ts.Spline("float")
    for code, angle in CURVE:
        knot = ts.Knot("float")
        knot.SetTime(code)
        knot.SetValue(angle)
        knot.SetNextInterpolation(ts.InterpLinear)
        spline.SetKnot(knot)
    return spline


def test_a_root_on_animation_curves_moves_as_one_with_samples(tmp_path):
    ts = pytest.importorskip("pxr.Ts")
    rigs = []
    for curved in (False, True):
        path = write_shot(tmp_path, Recipe(frames=0), f"curved_{curved}")
        stage = Usd.Stage.Open(str(path))
        turn = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddRotateYOp().GetAttr()
        for code, angle in CURVE:
            turn.Set(angle, code)
        if curved:
            turn.Clear()
            turn.SetSpline(_spline(ts))
        stage.GetRootLayer().Save()
        rigs.append(read_rigs(path)[0])
    assert rigs[1].joints.animated
    np.testing.assert_allclose(rigs[1].clip.joints, rigs[0].clip.joints, atol=1e-6)
    assert len(rigs[1].time_codes) == 9


def test_a_root_on_curves_that_go_on_is_not_said_to_stand_still(tmp_path):
    ts = pytest.importorskip("pxr.Ts")
    path = write_shot(tmp_path, Recipe(frames=0))
    for mode, held in ((ts.ExtrapHeld, True), (ts.ExtrapLoopRepeat, False)):
        stage = Usd.Stage.Open(str(path))
        spline = _spline(ts)
        spline.SetPostExtrapolation(ts.Extrapolation(mode))
        root = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero"))
        (root.GetRotateYOp() or root.AddRotateYOp()).GetAttr().SetSpline(spline)
        stage.GetRootLayer().Save()
        assert bool(out_of_range(read_rigs(path)[0], 1, 49)) == held


def test_a_skeleton_is_chosen_by_path_or_by_a_name_of_its_own(tmp_path):
    write_shot(tmp_path, Recipe(frames=0), "one")
    stage = Usd.Stage.CreateInMemory()
    for name in ("A", "B"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(str(tmp_path / "one.usda"))
    assert [str(p.GetPath()) for p in find_skeletons(stage)] == ["/A/Rig", "/B/Rig"]
    assert [str(p.GetPath()) for p in find_skeletons(stage, "/B/Rig")] == ["/B/Rig"]
    with pytest.raises(NeuralocksError, match="Rig: several skeletons have this name; .* of: /A/Rig, /B/Rig$"):
        find_skeletons(stage, "Rig")
    with pytest.raises(NeuralocksError, match="Neck: no such skeleton; .* of: /A/Rig, /B/Rig$"):
        find_skeletons(stage, "Neck")
    stage.RemovePrim("/A")
    assert [str(p.GetPath()) for p in find_skeletons(stage, "Rig")] == ["/B/Rig"]


def test_an_animation_within_one_frame_is_told(tmp_path):
    """Seconds of samples, one a time code, in a stage that says that 4800 of these are a second."""
    for rate, frames, told in ((4800, 60, True), (4800, 5, False), (24, 60, False)):
        stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(frames=frames), f"at_{rate}_{frames}")))
        stage.SetTimeCodesPerSecond(rate)
        stage.GetRootLayer().Save()
        rig = read_rigs(stage.GetRootLayer().realPath)[0]
        notes = out_of_range(rig, 1, frames)
        assert notes == (
            [
                "/Hero/Rig: all 60 samples of its animation lie within one frame, which is 200 time codes; check the "
                "stage's timeCodesPerSecond and framesPerSecond"
            ]
            if told
            else []
        )
