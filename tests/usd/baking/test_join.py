# SPDX-License-Identifier: Apache-2.0
"""Parts of a range, baked by the machines of a farm, are the one bake."""

import json
import os

import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdUtils, Vt
from typer.testing import CliRunner

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.baking.join import join
from usd.cli.app import app
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import model_for, small_shot
from ..shots import Recipe, samples, write_shot


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    return write_shot(tmp_path_factory.mktemp("join"), Recipe(bound="mesh", frames=12))


def parts_of(shot, folder, model, ranges=("7:12", "1:4", "5:6"), **options):
    baked = [(folder / f"part{i}.usdc", frames) for i, frames in enumerate(ranges)]
    return [bake(shot, path, model, frames=frames, **options).path for path, frames in baked]


@pytest.mark.parametrize(
    ("ending", "options"), [("usdc", {}), ("usda", {"subframes": 3}), ("usdc", {"velocities": False, "cuts": [4]})]
)
def test_joined_parts_are_the_one_bake_byte_for_byte(shot, tmp_path, model, ending, options):
    whole = bake(shot, tmp_path / f"whole.{ending}", model, **options).path
    (tmp_path / "farm").mkdir()
    joined = join(parts_of(shot, tmp_path / "farm", model, **options), tmp_path / f"hair.{ending}")
    assert joined.path.read_bytes() == whole.read_bytes()
    assert not joined.notes and len(joined.frames) == 12 * options.get("subframes", 1)
    assert sorted(os.listdir(tmp_path)) == sorted(["farm", whole.name, joined.path.name])


@pytest.mark.parametrize("subframes", [1, 3])
def test_parts_of_a_stage_that_counts_seconds(shot, tmp_path, model, subframes):
    """Frames are not whole numbers there; a part's outer frames have the same numbers as in the other parts."""
    stage = Usd.Stage.CreateNew(str(tmp_path / "seconds.usda"))
    stage.SetTimeCodesPerSecond(1)
    stage.SetFramesPerSecond(24)
    stage.GetRootLayer().subLayerPaths.append(str(shot))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, "Y")
    stage.SetStartTimeCode(1 / 24)
    stage.SetEndTimeCode(12 / 24)
    stage.Save()
    whole = bake(tmp_path / "seconds.usda", tmp_path / "whole.usdc", model, subframes=subframes)
    assert len(whole.frames) == 12 * subframes
    ranges = (f"0.0416667:{whole.frames[6 * subframes]}", f"{whole.frames[7 * subframes]:.6g}:0.5")
    parts = parts_of(tmp_path / "seconds.usda", tmp_path, model, ranges, subframes=subframes)
    joined = join(parts, tmp_path / "hair.usdc").path
    assert joined.read_bytes() == whole.path.read_bytes()


def test_usds_own_stitching_gives_the_same_values(shot, tmp_path, model):
    """This is what `usdstitch` does; in a stack of layers, the weaker one's samples would be hidden."""
    parts = parts_of(shot, tmp_path, model)
    stitched = Sdf.Layer.CreateAnonymous(".usda")
    for part in parts:
        UsdUtils.StitchLayers(stitched, Sdf.Layer.FindOrOpen(str(part)))
    joined = join(parts, tmp_path / "hair.usdc").path
    assert stitched.ExportToString() == Sdf.Layer.FindOrOpen(str(joined)).ExportToString()


def test_several_grooms_and_shots_without_a_range(tmp_path, model):
    """Grooms come in the shot's order, and the range is that of all parts."""
    path = write_shot(tmp_path, Recipe(frames=12))
    layer = Sdf.Layer.FindOrOpen(str(path))
    Sdf.CopySpec(layer, "/Hero/Hair", layer, "/Hero/Beard")
    for key in ("startTimeCode", "endTimeCode"):
        layer.pseudoRoot.ClearInfo(key)
    layer.Save()
    whole = bake(path, tmp_path / "whole.usdc", model).path
    joined = join(parts_of(path, tmp_path, model), tmp_path / "hair.usdc")
    assert joined.grooms == ["/Hero/Hair", "/Hero/Beard"]
    assert joined.path.read_bytes() == whole.read_bytes()


def test_overlaps_and_gaps(shot, tmp_path, model):
    parts = parts_of(shot, tmp_path, model, ("1:4", "3:5", "9:12"))
    result = CliRunner().invoke(app, ["join", *map(str, parts), "-o", str(tmp_path / "hair.usdc"), "--json"])
    told = json.loads(result.stdout)
    assert told["frames"] == [1, 2, 3, 4, 5, 9, 10, 11, 12]
    assert told["notes"] == ["no part has samples between 5 and 9"] and told["complete"] is False
    groom = inspect(tmp_path / "hair.usdc")["grooms"][0]
    assert groom["samples"] == {"first": 1, "last": 12, "number": 9, "missing": ["between 5 and 9"]}
    layer = Sdf.Layer.FindOrOpen(str(tmp_path / "hair.usdc"))
    layer.ClearStartTimeCode()
    layer.ClearEndTimeCode()
    layer.Export(str(tmp_path / "open.usda"))  # a stage that does not say where it ends lacks nothing before or after
    assert inspect(tmp_path / "open.usda")["grooms"][0]["samples"]["missing"] == ["between 5 and 9"]
    whole = bake(shot, tmp_path / "whole.usdc", model).path
    for code in told["frames"]:
        assert (
            samples(tmp_path / "hair.usdc", "points", at=code).tobytes() == samples(whole, "points", at=code).tobytes()
        )


def test_a_part_without_its_subframes(shot, tmp_path, model):
    fine, coarse = parts_of(shot, tmp_path, model, ("1:4", "9:12"), subframes=3), tmp_path / "coarse.usdc"
    bake(shot, coarse, model, frames="5:8")
    joined = join([*fine, coarse], tmp_path / "hair.usdc")
    assert joined.complete
    assert joined.notes == [
        "4 of 12 frames, the first at 5, have fewer samples than others, which have 3; "
        "bake them again with the same --subframes, unless that is meant"
    ]


@pytest.mark.parametrize("frames", ["1:9:0.5", "1:9:0.7", "1:9:2"])
def test_frames_that_are_not_thinned(shot, tmp_path, model, frames):
    part = bake(shot, tmp_path / "part.usdc", model, frames=frames).path
    assert not any("fewer samples" in note for note in join([part], tmp_path / "hair.usdc").notes)


def test_steps_are_no_gaps(shot, tmp_path, model):
    parts = parts_of(shot, tmp_path, model, ("3:5:2", "7:9:2"), subframes=3)
    joined = join(parts, tmp_path / "hair.usdc")
    assert joined.notes == ["no part has samples before 3, after 9.66667"]
    whole = bake(shot, tmp_path / "whole.usdc", model, frames="3:9:2", subframes=3).path
    assert joined.path.read_bytes() == whole.read_bytes()


def test_an_open_stage_sees_what_was_joined(shot, tmp_path, model):
    parts = parts_of(shot, tmp_path, model)
    out = join(parts[:1], tmp_path / "hair.usdc").path
    stage = Usd.Stage.Open(str(out))
    points = stage.GetAttributeAtPath("/Hero/Hair.points")
    assert points.GetNumTimeSamples() == 6
    join(parts, out)
    assert points.GetNumTimeSamples() == 12


def test_what_does_not_belong_together_is_refused(shot, tmp_path, model):
    part, other = tmp_path / "part.usdc", tmp_path / "other.usdc"
    bake(shot, part, model, frames="1:4")
    stage = Usd.Stage.CreateNew(str(tmp_path / "empty.usda"))
    stage.GetRootLayer().Save()
    for name, prim in (("shot", ("/Hero", "shot")), ("unsampled", ("/Hero/Hair", {"solver": "rods"}))):
        stage = Usd.Stage.CreateNew(str(tmp_path / f"{name}_alone.usda"))
        stage.OverridePrim(prim[0]).SetCustomDataByKey("neuralocks", prim[1])
        stage.GetRootLayer().Save()
    (tmp_path / "broken.usdc").write_bytes(part.read_bytes()[:-300])
    (tmp_path / "folder.usdc").mkdir()
    (tmp_path / "groom.tfx").write_bytes(b"HairAsset Version 2.0")
    rigged = small_shot(tmp_path / "rigged.usda")
    bake_rig(rigged, tmp_path / "rig.usdc", model_for(read_rigged_hair(rigged)))
    elsewhere = write_shot(tmp_path, Recipe(bound="mesh", frames=12), "elsewhere")
    for frames_of, options, said in (
        (
            shot,
            {"material": ["stiffness=2x"]},
            "other.usdc: /Hero/Hair was baked with different material than in .*part.usdc",
        ),
        (shot, {"strength": 0.5, "resolve": False}, "different resolve, strength than"),
        (shot, {"joints": {"upper_chest": "spine"}}, "different joints than"),
        (shot, {"velocities": False}, "different velocities than"),
        (elsewhere, {}, "is a bake of a different shot from .*part.usdc"),
        (None, "empty.usda", "is not a bake"),
        (None, "shot_alone.usda", "is not a bake"),
        (None, "unsampled_alone.usda", "is not a bake"),
        (None, "broken.usdc", "broken.usdc: cannot be read"),
        (None, "missing.usdc", "missing.usdc: no such file; check the path"),
        (None, "folder.usdc", "folder.usdc: is a folder; name"),
        (None, "groom.tfx", "groom.tfx: is not a bake; give files that neuralocks bake wrote"),
        (None, "rig.usdc", "rig.usdc: is a rig bake, and these are not joined from parts; bake all"),
    ):
        second = (
            tmp_path / options if frames_of is None else bake(frames_of, other, model, frames="5:6", **options).path
        )
        with pytest.raises(NeuralocksError, match=said):
            join([part, second], tmp_path / "hair.usdc")
    with pytest.raises(NeuralocksError, match="is one of the parts"):
        join([part], part)
    with pytest.raises(NeuralocksError, match="is read as well, as a file or a layer of it"):
        join([part], shot)
    assert not (tmp_path / "hair.usdc").exists() and not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(
    ("name", "break_it", "fact"),
    [
        ("points", lambda points: points[:-1], "has 479 values for 480"),
        ("velocities", lambda velocities: velocities[:3], "has 3 values for 480"),
        ("extent", lambda extent: Vt.Vec3fArray(1, extent[0]), "has 1 values for 2"),
        ("points", lambda points: Vt.Vec3fArray(len(points), Gf.Vec3f(float("nan"))), "holds NaN or infinity"),
    ],
)
def test_a_damaged_frame_within_a_part_is_named(shot, tmp_path, model, name, break_it, fact):
    first, second = parts_of(shot, tmp_path, model, ("1:2", "3:5"))
    layer, path = Sdf.Layer.FindOrOpen(str(second)), f"/Hero/Hair.{name}"
    layer.SetTimeSample(path, 4, break_it(layer.QueryTimeSample(path, 4)))
    layer.Save()
    with pytest.raises(NeuralocksError, match=rf"part1\.usdc: {path} {fact} at 4; bake that part again"):
        join([first, second], tmp_path / "hair.usdc")
    assert not (tmp_path / "hair.usdc").exists()


def test_a_lone_part_needs_no_list(shot, tmp_path, model):
    part = bake(shot, tmp_path / "part.usdc", model).path
    for each in (str(part), part):
        assert join(each, tmp_path / "hair.usdc").path.read_bytes() == part.read_bytes()
    with pytest.raises(NeuralocksError, match="parts: 3 is not a path"):
        join(3, tmp_path / "hair.usdc")


def test_a_stopped_join_leaves_nothing(shot, tmp_path, model):
    def stop(*_):
        raise KeyboardInterrupt

    parts = parts_of(shot, tmp_path, model)
    with pytest.raises(KeyboardInterrupt):
        join(parts, tmp_path / "hair.usdc", progress=stop)
    assert sorted(os.listdir(tmp_path)) == sorted(part.name for part in parts)


def test_a_killed_join_leaves_no_layer_to_the_next(shot, tmp_path, model, monkeypatch):
    parts, out = parts_of(shot, tmp_path, model), tmp_path / "hair.usdc"
    layers = []

    def look(done, total, message):
        layers.append(len(list(tmp_path.glob(".hair.usdc.baking/*.usdc"))))
        if done == 4:
            raise KeyboardInterrupt

    with monkeypatch.context() as killed:
        killed.setattr("usd.baking.join.Spool.discard", lambda spool: spool._lock.release())
        for _ in range(3):
            with pytest.raises(KeyboardInterrupt):
                join(parts, out, progress=look)
    join(parts, out)
    assert set(layers) == {1}


@pytest.mark.parametrize(
    ("rate", "frames", "begin", "end", "parts"),
    [(24.0, 12, 0.3, 12.8, ("1:6", "7:12")), (1000.0, 120, 1, 120, ("1:50", "84.333333:120"))],
)
def test_less_than_a_frame_at_the_ends_of_a_shot_is_no_gap(tmp_path, model, rate, frames, begin, end, parts):
    path = write_shot(tmp_path, Recipe(rate=rate, frames=frames))
    stage = Usd.Stage.Open(str(path))
    stage.SetFramesPerSecond(24)
    stage.SetStartTimeCode(begin)
    stage.SetEndTimeCode(end)
    stage.Save()
    whole = bake(path, tmp_path / "whole.usdc", model)
    joined = join(parts_of(path, tmp_path, model, parts), tmp_path / "hair.usdc")
    assert joined.frames == whole.frames and not joined.notes


@pytest.mark.parametrize(("frames", "missed"), [("1:8", "after 8"), ("2:9", "before 2")])
def test_a_frame_that_the_range_of_the_shot_only_has_up_to_rounding_is_missed(tmp_path, model, frames, missed):
    path = write_shot(tmp_path, Recipe(strands=6))
    layer = Sdf.Layer.FindOrOpen(str(path))
    layer.startTimeCode, layer.endTimeCode = 1.00002, 8.99998
    layer.Save()
    joined = join(bake(path, tmp_path / "part.usdc", model, frames=frames).path, tmp_path / "hair.usdc")
    assert joined.notes == [f"no part has samples {missed}"] and not joined.complete
