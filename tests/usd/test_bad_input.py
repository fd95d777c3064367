# SPDX-License-Identifier: Apache-2.0
"""Wrong arguments, damaged files and full disks give one line that names the file or argument, and leave nothing behind; what is
only odd is baked, with a note.
"""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import cannot_write
from usd.assets.grow import grow
from usd.assets.importing import import_groom
from usd.baking.bake import bake
from usd.baking.join import join
from usd.baking.layer.spool import Spool
from usd.models.train import train
from usd.review.demo import demo
from usd.review.evaluate import evaluate
from usd.review.inspect import inspect
from usd.review.picture import preview
from usd.rig.train import train_rig
from usd.shot.stage import read_shot

from .shots import HAIR, SKIN, Recipe, edited, write_shot


@pytest.mark.parametrize("name", ["hair.tfx", "hair.HAIR"])
def test_a_hair_file_in_place_of_a_stage_is_told_to_be_imported(tmp_path, model, name):
    (tmp_path / name).write_bytes(b"HAIR")
    with pytest.raises(NeuralocksError, match="is a hair file; make a USD groom of it with 'neuralocks import'"):
        bake(tmp_path / name, tmp_path / "out.usdc", model)


def test_a_model_in_place_of_a_stage_is_told_where_it_goes(tmp_path, model):
    for work in (lambda: bake(model, tmp_path / "out.usdc"), lambda: preview(model, tmp_path / "out.png")):
        with pytest.raises(NeuralocksError, match="is a trained model, not a scene; name a USD file here"):
            work()


WRONG = {
    "prim": ({"grooms": ["/Hero/Nope"]}, "/Hero/Nope: no such prim"),
    "no prim path": ({"grooms": ["Hair"]}, "Hair: not a prim path"),
    "not a groom": ({"grooms": ["/Hero/Skin"]}, "without BasisCurves"),
    "skeleton": ({"skeleton": "/Nope"}, "/Nope: no such skeleton"),
    "head": ({"head": "nose"}, "nose"),
    "frames": ({"frames": "5:1"}, "5:1"),
    "no step": ({"frames": "1:5:0"}, "1:5:0: the range is empty"),
    "a step back": ({"frames": "1:5:-1"}, "1:5:-1: the range is empty"),
    "words as frames": ({"frames": "a:b"}, "a:b"),
    "endless frames": ({"frames": "0:1e12"}, "samples"),
    "more frames than numbers": ({"frames": "0:1e300:1e-300"}, "samples"),
    "jobs": ({"jobs": 0}, "--jobs 0"),
    "too many jobs": ({"jobs": 5000}, "1 to 1024"),
    "subframes": ({"subframes": 0}, "--subframes 0"),
    "material": ({"material": ["colour=3"]}, "colour"),
    "material range": ({"material": ["bend=1e9"]}, "bend"),
    "model": ({"model": "nope.neuralocks"}, "nope.neuralocks"),
    "folder as model": ({"model": "."}, "is a folder"),
    "number as model": ({"model": 5}, "model: 5 is not a path"),
    "number as groom": ({"grooms": 5}, "grooms: 5 is not a prim path"),
    "number as skeleton": ({"skeleton": 5}, "skeleton: 5 is not a prim path"),
    "number as frames": ({"frames": 5}, "frames: 5 holds no time codes"),
    "word as cuts": ({"cuts": "none"}, "cuts: 'none' holds no time codes; give a list .*, or .. if there are none"),
    "word as strength": ({"strength": "1"}, "--strength '1': must be a number from 0 to 4"),
    "no strength": ({"strength": float("nan")}, "--strength nan: must be"),
    "truth as jobs": ({"jobs": True}, "--jobs True: must be a whole number"),
    "word as resolve": ({"resolve": "false"}, "--resolve 'false': must be True or False"),
    "word as loop": ({"loop": "no"}, "--loop 'no': must be True or False"),
    "number as velocities": ({"velocities": 0}, "--velocities 0: must be True or False"),
    "no velocities": ({"velocities": None}, "--velocities None: must be True or False"),
    "list as joints": ({"joints": ["a"]}, "--joint .*'a'.*must be a dict"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_argument_is_named(tmp_path, model, case):
    arguments, text = WRONG[case]
    recipe = Recipe(bound="none") if case == "head" else Recipe()
    with pytest.raises(NeuralocksError, match=text.replace("(", ".")):
        bake(write_shot(tmp_path, recipe), tmp_path / "out.usdc", **{"model": model, **arguments})
    assert [p.name for p in tmp_path.iterdir()] == ["shot.usda"]


@pytest.mark.parametrize(
    ("name", "work"),
    [
        ("--reference", lambda flag: evaluate("shot.usda", flag)),
        ("--turntable", lambda flag: preview("shot.usda", "out.png", turntable=flag)),
        ("--clip", lambda flag: demo("out", clip=flag)),
        ("--with-character", lambda flag: grow("bob", "shot.usda", "out.usda", with_character=flag)),
        ("--with-character", lambda flag: import_groom("hair.tfx", "out.usda", with_character=flag)),
        ("--paper", lambda flag: train("shot.usda", [], [], "out.neuralocks", {}, paper=flag)),
        ("--resume", lambda flag: train("shot.usda", [], [], "out.neuralocks", {}, resume=flag)),
        ("--keep-work", lambda flag: train("shot.usda", [], [], "out.neuralocks", {}, keep_work=flag)),
        ("dynamic", lambda flag: train_rig("shot.usda", "out.neuralocks", dynamic=flag)),
        ("early", lambda flag: train_rig("shot.usda", "out.neuralocks", early=flag)),
    ],
)
def test_a_word_is_neither_true_nor_false(tmp_path, monkeypatch, name, work):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(NeuralocksError, match=f"{name} 'false': must be True or False"):
        work("false")
    assert not list(tmp_path.iterdir())


def test_a_flag_may_be_numpys(tmp_path, model):
    shot = write_shot(tmp_path)
    for resolve in (False, np.False_):
        bake(shot, tmp_path / f"{type(resolve).__name__}.usda", model, frames="1", resolve=resolve)
    assert (tmp_path / "bool.usda").read_text() == (tmp_path / f"{type(np.False_).__name__}.usda").read_text()


@pytest.mark.parametrize("content", [b"", b"PXR-USDC" + bytes(80), b"#usda 1.0\ndef (", b"PK\x03\x04junk"])
@pytest.mark.parametrize("extension", ["usda", "usdc", "usdz"])
def test_no_usd_file_is_said_so(tmp_path, model, content, extension):
    path = tmp_path / f"bad.{extension}"
    path.write_bytes(content)
    with pytest.raises(NeuralocksError, match="bad"):
        bake(path, tmp_path / "out.usdc", model)


def test_truncated_crate_is_refused(tmp_path, model):
    path = write_shot(tmp_path, Recipe(extension="usdc"))
    data = path.read_bytes()
    path.unlink()
    for size in (10, 60, len(data) // 2, len(data) - 5):
        cut = tmp_path / f"cut{size}.usdc"
        cut.write_bytes(data[:size])
        with pytest.raises(NeuralocksError):
            bake(cut, tmp_path / "out.usdc", model)
        cut.unlink()
    assert not list(tmp_path.iterdir())


def test_values_that_cannot_be_unpacked_are_said_so(tmp_path, model):
    """Damage in the middle of a crate file: it opens, and its samples are gone."""
    path = write_shot(tmp_path, Recipe(extension="usdc", frames=40, vertices=24))
    whole = path.read_bytes()
    found = set()
    for place in range(200, len(whole) - 4000, len(whole) // 24):
        broken = tmp_path / f"{place}.usdc"
        broken.write_bytes(whole[:place] + b"\xff" * 64 + whole[place + 64 :])
        try:
            read_shot(broken)
        except NeuralocksError as error:
            assert str(error).startswith(str(broken)) or "/Hero" in str(error)
            found.add("damaged" in str(error))
            if "damaged" in str(error):
                with pytest.raises(NeuralocksError, match=f"{place}.usdc: .*damaged"):
                    read_shot(joints={}, path=broken)
    assert True in found


def test_bytes_that_are_no_text_are_said_so(tmp_path, model):
    """USD quotes them in its errors, and returns them for names in a crate file."""
    text, crate = write_shot(tmp_path), tmp_path / "latin.usdc"
    Sdf.Layer.FindOrOpen(str(text)).Export(str(crate))
    latin, above = tmp_path / "latin.usda", tmp_path / "above.usda"
    latin.write_bytes(text.read_bytes().replace(b"#usda 1.0", b"#usda 1.0\n# caf\xe9", 1))
    crate.write_bytes(crate.read_bytes().replace(b"hips", b"h\xe9ps"))
    above.write_text(f"#usda 1.0\n(\n    subLayers = [@{latin.name}@, @{text.name}@]\n)\n")
    fact = r"holds bytes that are not UTF-8\)"
    for read in (read_shot, inspect, lambda path: join(path, tmp_path / "out.usdc")):
        with pytest.raises(NeuralocksError, match=rf"latin\.usda: .*{fact}; "):
            read(latin)
    with pytest.raises(NeuralocksError, match=rf"latin\.usdc: .*damaged \({fact}; export it again"):
        read_shot(crate)
    result = bake(above, tmp_path / "elsewhere" / "out.usdc", model, frames="1:2")
    assert any(note.startswith("above.usda: ") and "latin.usda" in note for note in result.notes)


def test_a_primvar_that_cannot_be_unpacked_is_said_of_the_file_that_is_imported(tmp_path):
    """It opens, and most of it is the numbers of one primvar."""
    path, rng = write_shot(tmp_path, Recipe(extension="usdc")), np.random.default_rng(0)
    stage = Usd.Stage.Open(str(path))
    primvar = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath(HAIR)).CreatePrimvar("groom_x", Sdf.ValueTypeNames.IntArray)
    primvar.Set(Vt.IntArray.FromNumpy(rng.integers(0, 3, 40_000, np.int32)))
    stage.Export(str(tmp_path / "groom.usdc"))
    whole = (tmp_path / "groom.usdc").read_bytes()
    place, broken = len(whole) // 2, tmp_path / "broken.usdc"
    broken.write_bytes(whole[:place] + b"\xff" * 9000 + whole[place + 9000 :])
    with pytest.raises(NeuralocksError, match=r"broken.usdc: .*damaged"):
        import_groom(broken, tmp_path / "out.usda")


@pytest.mark.parametrize("end", [float("inf"), float("nan"), -3.0])
def test_a_range_that_cannot_be_meant_gives_way_to_the_animations(tmp_path, model, end):
    shot = edited(tmp_path, lambda stage: (stage.SetStartTimeCode(1), stage.SetEndTimeCode(end)))
    done = bake(shot, tmp_path / "out.usda", model, velocities=False)
    assert done.frames == [*range(1, 10)]
    told = f"shot.usda: from its startTimeCode 1 to its endTimeCode {end:g} is no range, so the animation's own counts"
    for notes in (done.notes, inspect(shot)["spoils"]):
        assert [note.partition(";")[0] for note in notes if "startTimeCode" in note] == [told]


def test_one_frame_is_a_held_pose(tmp_path, model):
    result = bake(write_shot(tmp_path, Recipe(frames=1)), tmp_path / "out.usdc", model)
    assert result.frames == [1.0] and any("one sample" in note for note in result.notes)
    layer = Sdf.Layer.FindOrOpen(str(result.path))
    assert not np.any(layer.QueryTimeSample(f"{HAIR}.velocities", 1.0))


def test_missing_blend_shapes_and_references_are_noted(tmp_path, model):
    def edit(stage):
        binding = UsdSkel.BindingAPI(stage.GetPrimAtPath(SKIN))
        binding.CreateBlendShapesAttr(["smile", "frown"])
        binding.CreateBlendShapeTargetsRel().SetTargets([f"{SKIN}/smile"])
        stage.GetPrimAtPath("/Hero").GetReferences().AddReference("./missing.usd")

    result = bake(edited(tmp_path, edit), tmp_path / "out.usdc", model)
    assert any("blend shape" in note for note in result.notes)
    assert any("missing.usd" in note for note in result.notes)


def test_a_body_that_is_inside_out_is_turned_round(tmp_path, model):
    def turned_round(stage):
        faces = UsdGeom.Mesh.Get(stage, SKIN).GetFaceVertexIndicesAttr()
        faces.Set(np.array(faces.Get()).reshape(-1, 4)[:, ::-1].ravel().tolist())

    right = bake(write_shot(tmp_path, name="as_made"), tmp_path / "right.usdc", model, frames=[5])
    wrong = bake(edited(tmp_path, turned_round), tmp_path / "wrong.usdc", model, frames=[5])
    assert not any("inside out" in note for note in right.notes) and any("inside out" in note for note in wrong.notes)
    points = [
        np.asarray(Sdf.Layer.FindOrOpen(str(r.path)).QueryTimeSample(f"{HAIR}.points", 5.0)) for r in (right, wrong)
    ]
    assert np.abs(points[0] - points[1]).max() < 2e-3


def test_strands_without_length_follow_the_head(tmp_path, model):
    def edit(stage):
        target = stage.GetPrimAtPath(HAIR).GetAttribute("points")
        points = np.array(target.Get())
        points[12:24] = points[12]
        target.Set(Vt.Vec3fArray.FromNumpy(points))

    result = bake(edited(tmp_path, edit), tmp_path / "out.usdc", model, frames=[5])
    assert any("1 of 40 strands" in note for note in result.notes)
    points = np.asarray(Sdf.Layer.FindOrOpen(str(result.path)).QueryTimeSample(f"{HAIR}.points", 5.0))
    assert np.isfinite(points).all() and np.ptp(points[12:24], axis=0).max() < 1e-6


def test_no_space_and_read_only_folders(tmp_path, model, monkeypatch):
    shot = write_shot(tmp_path)
    target = tmp_path / "file"
    target.write_text("")
    for out in (target / "out.usdc", target / "deeper" / "out.usdc"):  # a file where a folder should be
        with pytest.raises(NeuralocksError, match="a file, not a folder"):
            bake(shot, out, model)

    def full(self, *arguments):
        raise cannot_write(self.out, OSError(28, "No space left on device"))

    monkeypatch.setattr(Spool, "write", full)
    with pytest.raises(NeuralocksError, match="no space left"):
        bake(shot, tmp_path / "out.usdc", model)
    monkeypatch.setattr("usd.baking.samples.shutil.disk_usage", lambda folder: type("Usage", (), {"free": 1000}))
    with pytest.raises(NeuralocksError, match="needs"):
        bake(shot, tmp_path / "out.usdc", model)
    assert {p.name for p in tmp_path.iterdir()} == {"shot.usda", "file"}
