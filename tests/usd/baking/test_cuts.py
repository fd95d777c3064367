# SPDX-License-Identifier: Apache-2.0
"""Strands of a character that is put elsewhere within a shot: the way there is none that hair or camera sees."""

import re

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdSkel, Vt
from typer.testing import CliRunner

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.cli.app import app
from usd.cli.options import cut_codes
from usd.review.baked import read_baked
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect
from usd.shot.bakes.bake_record import recorded
from usd.shot.stage import read_shot

from ..shots import Recipe, samples, write_loop, write_shot

CUT, LAST = 13, 24


@pytest.fixture(scope="module")
def shots(tmp_path_factory):
    """A shot whose character jumps 3 m aside at frame 13, and the same shot from that frame on."""
    folder = tmp_path_factory.mktemp("cuts")
    path = write_shot(folder, Recipe(frames=LAST, strands=8))
    stage = Usd.Stage.Open(str(path))
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    for code in range(CUT, LAST + 1):
        places = np.array(motion.GetTranslationsAttr().Get(code))
        places[0, 0] += 3
        motion.GetTranslationsAttr().Set(Vt.Vec3fArray.FromNumpy(places), code)
    stage.GetRootLayer().Save()
    for code in range(1, CUT):
        motion.GetTranslationsAttr().ClearAtTime(code)
        motion.GetRotationsAttr().ClearAtTime(code)
    stage.SetStartTimeCode(CUT)
    stage.GetRootLayer().Export(str(folder / "after.usda"))
    return path, folder / "after.usda"


@pytest.fixture(scope="module")
def bakes(shots, model):
    whole, after = shots
    wanted = {"found": (whole, None), "given": (whole, [CUT]), "none": (whole, []), "after": (after, None)}
    return {
        name: bake(shot, whole.with_name(f"{name}.usdc"), model, cuts=cuts) for name, (shot, cuts) in wanted.items()
    }


def test_a_shot_that_was_read_has_its_cuts_and_joints(shots, bakes, model, tmp_path):
    """Given to the bake instead, they would be recorded, but not used."""
    path = shots[0]
    with pytest.raises(NeuralocksError, match="is read already, so 'cuts' comes too late; give it to read_shot"):
        bake(read_shot(path), tmp_path / "late.usdc", model, cuts=[])
    read = read_shot(path, joints={"neck": "neck"}, cuts=np.array([CUT]))
    with pytest.raises(NeuralocksError, match="a loop has none"):
        bake(read, tmp_path / "loop.usdc", model, loop=True)
    out = bake(read, tmp_path / "read.usdc", model, frames=[CUT]).path
    again = bake(read_baked(out).shot, tmp_path / "again.usdc", model, frames=[CUT]).path
    stages = [Usd.Stage.Open(str(path)) for path in (out, again)]
    first, second = (recorded(stage.GetPrimAtPath("/Hero/Hair")) for stage in stages)
    assert first["cuts"] == second["cuts"] == [CUT] and first["joints"] == {"neck": "neck"}
    given = samples(bakes["given"].path, "points", at=CUT)
    np.testing.assert_array_equal(samples(out, "points", at=CUT), given)


def test_a_shot_that_was_read_is_a_loop_only_without_cuts(shots, model, tmp_path):
    """As one that is read for the loop: cuts that were found would be in its velocities."""
    with pytest.raises(NeuralocksError, match=r"was read with cuts, and a loop has none; give cuts=\[\] to read_shot"):
        bake(read_shot(shots[0]), tmp_path / "loop.usdc", model, loop=True)
    path = write_loop(tmp_path)
    outs = [
        bake(shot, tmp_path / "hair.usdc", model, frames="1:2", loop=True).path.read_bytes()
        for shot in (path, read_shot(path))
    ]
    assert outs[0] == outs[1]


def test_cuts_that_are_found_are_told_also_where_another_character_has_given_ones(shots, model, tmp_path):
    shot = read_shot(shots[0], cuts={"/Other/Rig": [5.0]})
    notes = bake(shot, tmp_path / "hair.usdc", model, frames=[CUT]).notes
    assert any(note.startswith("/Hero/Rig: its head jumps to another place at 13;") for note in notes)


def test_hair_starts_anew_after_a_cut(bakes):
    assert any(note.startswith("/Hero/Rig: its head jumps to another place at 13;") for note in bakes["found"].notes)
    assert not any("another place" in note for name in ("given", "none", "after") for note in bakes[name].notes)
    for code in (1, CUT - 1, CUT, CUT + 3):
        found, given = (samples(bakes[name].path, "points", at=code) for name in ("found", "given"))
        np.testing.assert_array_equal(found, given)
    for code in (CUT, CUT + 3, LAST):
        found, after, none = (samples(bakes[name].path, "points", at=code) for name in ("found", "after", "none"))
        assert np.abs(found - after).max() < 1e-5
        assert code == LAST or np.abs(none - after).max() > 1e-3


def test_cuts_that_follow_each_other_at_once_are_told_with_what_makes_them_some(tmp_path, shots, model):
    """A flash of three frames would fling the hair twice, without a message."""
    layer = Sdf.Layer.CreateNew(str(tmp_path / "flash.usda"))
    layer.TransferContent(Sdf.Layer.FindOrOpen(str(shots[0])))
    stage = Usd.Stage.Open(layer)
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    for code in range(CUT + 3, LAST + 1):
        places = np.array(motion.GetTranslationsAttr().Get(code))
        places[0, 0] -= 3
        motion.GetTranslationsAttr().Set(Vt.Vec3fArray.FromNumpy(places), code)
    layer.Save()
    told = "/Hero/Rig: its head jumps at 13,16, less than 0.2 s from one jump to the next"
    (note,) = [note for note in inspect(layer.realPath)["spoils"] if "its head" in note]
    assert note.startswith(told) and "(--cuts 13,16)" in note
    assert note in bake(layer.realPath, tmp_path / "out.usdc", model).notes
    given = bake(layer.realPath, tmp_path / "given.usdc", model, cuts=[13, 16])
    assert not any("its head" in note for note in given.notes)


def test_a_cut_is_named_as_it_was_told(shots, tmp_path, model):
    """Samples of a layer at another rate lie between the stage's frames."""
    layer = Sdf.Layer.CreateNew(str(tmp_path / "faster.usda"))
    layer.timeCodesPerSecond, layer.startTimeCode, layer.endTimeCode = 30000 / 1001, 2, 29
    for name, value in (("metersPerUnit", 1.0), ("upAxis", "Y")):
        layer.pseudoRoot.SetInfo(name, value)
    Sdf.CreatePrimInLayer(layer, "/Hero").referenceList.Prepend(Sdf.Reference(str(shots[0]), "/Hero"))
    layer.Save()
    found = bake(layer.realPath, tmp_path / "found.usdc", model)
    (told,) = re.findall(r"jumps to another place at ([\d.]+);", " ".join(found.notes))
    assert float(told) == pytest.approx(CUT * 30000 / 1001 / 24, abs=5e-4) and round(float(told), 2) != float(told)
    for named in (float(told), np.ceil(float(told))):
        given = bake(layer.realPath, tmp_path / "given.usdc", model, cuts=[named])
        for code in found.frames:
            np.testing.assert_array_equal(*(samples(each.path, "points", at=code) for each in (found, given)))


def test_velocities_do_not_span_a_cut(bakes):
    """Otherwise motion blur would smear the hair along the whole jump."""
    for code in (CUT - 2, CUT - 1, CUT, CUT + 1):
        found, none = (samples(bakes[name].path, "velocities", at=code) for name in ("found", "none"))
        assert np.abs(found).max() < 5 and np.abs(none).max() > 5
        if code >= CUT:
            assert np.abs(found - samples(bakes["after"].path, "velocities", at=code)).max() < 1e-3


def test_a_bake_tells_the_cuts_that_were_given(bakes):
    for name, cuts in (("given", [CUT]), ("none", [])):
        item = read_baked(bakes[name].path).shot.grooms[0]
        assert list(recorded(item.prim)["cuts"]) == cuts
        assert len(item.attachment.rig.clip.cuts) == len(cuts)
    found = read_baked(bakes["found"].path).shot.grooms[0]
    assert "cuts" not in recorded(found.prim) and len(found.attachment.rig.clip.cuts) == 1


@pytest.mark.parametrize("way", ["reference", "sublayer"])
def test_cuts_of_a_bake_are_moved_with_its_samples(bakes, tmp_path, way):
    """By the offsets and scales of the layers and references above it."""
    path, above = bakes["given"].path, tmp_path / "above.usda"
    layer = Sdf.Layer.CreateNew(str(above))
    layer.timeCodesPerSecond = 48
    for name, value in (("metersPerUnit", 1.0), ("upAxis", "Y")):
        layer.pseudoRoot.SetInfo(name, value)
    if way == "sublayer":
        layer.subLayerPaths.append(str(path))
        layer.subLayerOffsets[0] = Sdf.LayerOffset(100)
    else:
        hero = Sdf.CreatePrimInLayer(layer, "/Hero")
        hero.referenceList.Prepend(Sdf.Reference(str(path), "/Hero", Sdf.LayerOffset(100)))
    layer.Save()
    (item,) = read_baked(above).shot.grooms
    rig, (cut,) = item.attachment.rig, item.attachment.rig.clip.cuts
    assert recorded(item.prim)["cuts"] == [100 + 2 * CUT]
    assert rig.time_codes[np.searchsorted(rig.clip.times, cut - 1e-9)] == 100 + 2 * CUT


def test_each_character_has_the_cuts_of_its_own_bake(shots, tmp_path, model):
    """One bake over another, of two characters in a shot."""
    stage = Usd.Stage.Open(str(shots[0]))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero", stage.GetRootLayer(), "/Twin")
    stage.GetRootLayer().Export(str(tmp_path / "two.usda"))
    first = bake(tmp_path / "two.usda", tmp_path / "first.usdc", model, grooms=["/Hero"], cuts=[7, 5, 7]).path
    second = bake(first, tmp_path / "second.usdc", model, grooms=["/Twin"], cuts=np.zeros(0)).path
    rigs = {item.attachment.rig.path: item.attachment.rig for item in read_baked(second).shot.grooms}
    assert rigs["/Hero/Rig"].clip.cuts * 24 == pytest.approx([5, 7])
    assert not len(rigs["/Twin/Rig"].clip.cuts)
    assert not any("another place" in note for note in inspect(second)["spoils"])


def test_a_loop_has_no_cuts(shots, tmp_path, model):
    made = [bake(shots[0], tmp_path / f"{i}.usdc", model, loop=True, cuts=cuts) for i, cuts in enumerate((None, []))]
    for bakes in made:
        (note,) = [note for note in bakes.notes if "another place" in note]
        assert note.startswith("/Hero/Rig: its head jumps to another place at 13; a loop has no cuts")
    whole = write_loop(tmp_path)
    assert not any("another place" in note for note in bake(whole, tmp_path / "whole.usdc", model, loop=True).notes)
    loops = [each.path for each in made]
    for name in ("points", "velocities"):
        assert (samples(loops[0], name, at=CUT) == samples(loops[1], name, at=CUT)).all()
    assert not len(read_baked(loops[0]).shot.rigs[0].clip.cuts)


@pytest.mark.parametrize("longer", ["range", "face"])
def test_a_loop_is_as_long_as_the_cycle_of_the_joints(tmp_path, model, longer):
    """Not as the shot's range, or as a face that goes on."""
    path = write_loop(tmp_path)
    plain = samples(bake(path, tmp_path / "plain.usdc", model, loop=True, frames="1:13").path, "points", at=13)
    stage = Usd.Stage.Open(str(path))
    if longer == "range":
        stage.SetEndTimeCode(20)
    else:
        animation = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
        animation.CreateBlendShapesAttr(["smile"])
        for code in range(1, 17):
            animation.CreateBlendShapeWeightsAttr().Set([code % 2], code)
    stage.Save()
    done = bake(path, tmp_path / "longer.usdc", model, loop=True)
    assert (samples(done.path, "points", at=13) == plain).all()
    outside = "/Hero/Rig: its animation goes from 1 to 13; outside that range the hair goes on"
    assert any(note.startswith(outside) for note in done.notes) == (longer == "range")


def test_the_reference_starts_anew_too(bakes):
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    from neuralocks_core.evaluation.comparison import simulated
    from neuralocks_core.strands.strand_set import strands_on

    moved = {}
    for name in ("given", "after", "none", "late"):
        baked = read_baked(bakes["given" if name == "late" else name].path)
        item = baked.shot.grooms[0]
        character = item.attachment.character
        times = baked.times[baked.codes >= CUT] if name in ("after", "late") else baked.times
        moved[name] = simulated(character, strands_on(character, item.groom), item.attachment.rig.clip, times)
    length = LAST + 1 - CUT
    for name in ("given", "late"):
        assert np.abs(moved[name][-length:] - moved["after"]).max() < 2e-3
    assert np.abs(moved["none"][-length:] - moved["after"]).max() > 0.02


def test_the_report_card_counts_no_motion_across_a_cut(bakes, shots, tmp_path, model):
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    speeds = []
    for first, last in ((1, CUT - 1), (CUT, LAST)):
        part = bake(shots[0], tmp_path / f"{first}.usdc", model, frames=f"{first}:{last}").path
        speeds += [evaluate(part).grooms["/Hero/Hair"]["speed_cm_s"]] * (last - first)
    whole = evaluate(bakes["found"].path, reference=True)
    assert whole.grooms["/Hero/Hair"]["speed_cm_s"] == pytest.approx(np.mean(speeds), rel=1e-4)
    assert whole.compared["/Hero/Hair"]["bake"]["dynamic_frames"] <= LAST - 2


def test_cuts_may_be_given_at_once_or_one_by_one():
    assert cut_codes(["5,7"]) == cut_codes(["5", "7"]) == [5, 7]
    assert cut_codes(["none"]) == []
    assert cut_codes(None) is cut_codes([]) is None


def test_what_no_cut_can_be_is_refused(shots, tmp_path, model):
    out = tmp_path / "bad.usdc"
    for options, words in (
        ({"cuts": [99]}, "--cuts 99: lies outside"),
        ({"cuts": [1]}, "--cuts 1: begins the animation, which goes from 1 to"),
        ({"cuts": [5], "loop": True}, "leave out --loop"),
    ):
        with pytest.raises(NeuralocksError, match=words):
            bake(shots[0], out, model, **options)
    told = CliRunner().invoke(app, ["bake", str(shots[0]), "-o", str(out), "--cuts", "5;7"])
    assert told.exit_code != 0
    assert not list(tmp_path.iterdir())
