# SPDX-License-Identifier: Apache-2.0
"""The command line: the same as Python, what it prints where it goes, and a quick start."""

import json
import os
import subprocess
import sys
import zipfile
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest
import typer

from neuralocks_core.hairstyles import STYLES
from neuralocks_core.json_values import plain
from neuralocks_core.models import model_file
from neuralocks_core.preview.pictures import CLIP_SIZE, STRIP_SIZE
from usd.assets.groom import write_groom
from usd.assets.importing import import_groom
from usd.baking.bake import bake
from usd.cli.command import command_of
from usd.review.inspect import inspect

from ...shared_data import SHARED
from ...strand_models import write_random_model
from ..commands import status
from ..shots import Recipe, write_shot

ROOT = Path(__file__).parents[3]


GROOMS = SHARED / "grooms"


def test_bake_is_the_python_function(tmp_path, model, capsys):
    shot = write_shot(tmp_path, Recipe(unit=0.01))
    words = ("bake", shot, "-o", tmp_path / "a.usdc", "--model", model, "--groom", "/Hero/Hair", "--frames", "2:6:2",
             "--material", "bend=2x", "--material", "weight=1.2", "--jobs", "2", "--json")  # fmt: skip
    assert status(*words) == 0
    told = json.loads(capsys.readouterr().out)
    bake(
        shot, tmp_path / "b.usdc", model, grooms=["/Hero/Hair"], frames="2:6:2", material={"bend": "2x", "weight": 1.2}
    )
    assert (tmp_path / "a.usdc").read_bytes() == (tmp_path / "b.usdc").read_bytes()
    assert told["frames"] == [2.0, 4.0, 6.0] and told["grooms"][0]["joint"].endswith("head")


def test_what_is_no_number_is_null_for_machines(tmp_path, model, capsys):
    """Somebody else's model may hold NaN, which Python writes but no other program reads."""
    odd = tmp_path / "odd.neuralocks"
    with zipfile.ZipFile(model) as old, zipfile.ZipFile(odd, "w") as new:
        for name in old.namelist():
            told = old.read(name)
            if name == "model.json":
                told = json.dumps(json.loads(told) | {"report": {"loss": float("nan"), "error": [float("inf"), 2.0]}})
            new.writestr(name, told)
    assert status("inspect", odd, "--json") == 0
    told = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert told["model"]["report"] == {"loss": None, "error": [None, 2.0]}
    assert status("export", odd, "-o", tmp_path) == 0
    json.loads((tmp_path / "description.json").read_text(), parse_constant=pytest.fail)
    assert plain({1: (np.float32(0.5), np.int64(3), np.nan)}) == {"1": [0.5, 3, None]}
    assert plain([1.23456789, 1.23456789e-9], digits=7) == [1.234568, 1.234568e-9]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names do not depend on the locale")
def test_of_a_locale_that_is_no_utf_8_a_name_is_innocent(tmp_path):
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-m", "usd", "inspect", "sch öt.usd".encode()]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, env=environment)
    assert done.stderr == b"error: sch \\xf6t.usd: its name is UTF-8, but the locale is not; set LC_ALL=C.UTF-8\n"


def test_what_is_printed_fits_the_code_page_of_where_it_goes(tmp_path, model):
    """A redirected stdout is often not UTF-8; the card's frames must not end in a traceback there."""
    shot, baked = write_shot(tmp_path), tmp_path / "髪.usdc"
    environment = {**os.environ, "PYTHONIOENCODING": "cp1252"}
    for words in (["bake", shot, "-o", baked, "--model", model], ["evaluate", baked]):
        command = [sys.executable, "-m", "usd", *map(str, words)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, env=environment)
        assert done.returncode == 0, done.stderr.decode()
    assert "vertices in the body" in done.stdout.decode("cp1252") and b"u2500" not in done.stdout


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_behind_stdout_is_one_line(tmp_path):
    command = [sys.executable, "-m", "usd", "inspect", str(write_shot(tmp_path))]
    for words in (command, [*command[:3], "--version"], [*command[:3], "bake", "--help"]):
        with open("/dev/full", "w") as full:
            done = subprocess.run(words, cwd=ROOT, stdout=full, stderr=subprocess.PIPE, text=True)
        assert done.returncode == 1 and done.stderr.startswith("error: output: ") and "Traceback" not in done.stderr
    read, write = os.pipe()
    os.close(read)  # as `neuralocks inspect | head` does once it has its lines
    with open(write, "w") as gone:
        done = subprocess.run(command, cwd=ROOT, stdout=gone, stderr=subprocess.PIPE, text=True)
    assert done.stderr == ""


@pytest.mark.skipif(os.name != "posix", reason="closes a shell's streams")
def test_a_caller_that_closed_the_streams_gets_its_files(tmp_path, model):
    shot, baked = write_shot(tmp_path), tmp_path / "baked.usdc"
    words = [sys.executable, "-m", "usd", "bake", str(shot), "-o", str(baked), "--model", str(model)]
    assert subprocess.run(["sh", "-c", '"$@" >&- 2>&-', "sh", *words], cwd=ROOT).returncode == 0
    assert baked.exists()


def test_help_breaks_its_lines_where_the_terminal_ends(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    assert status("bake", "--help") == 0
    assert "mute it to get the shot back. To resume a bake that was stopped, give" in capsys.readouterr().out


def test_help_tells_all_styles(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "400")
    assert status("grow", "--help") == 0
    *others, last = STYLES
    assert f"procedural library: {', '.join(others)} or {last}." in capsys.readouterr().out


def test_help_tells_the_sizes_of_pictures(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    assert status("preview", "--help") == 0
    strip, clip = ("x".join(map(str, size)) for size in (STRIP_SIZE, CLIP_SIZE))
    assert f"[default: ({strip} for a strip, {clip} for a clip)]" in capsys.readouterr().out


def test_the_version_is_told(capsys):
    assert status("--version") == 0
    assert capsys.readouterr().out.split()[0] == "neuralocks"


def test_a_source_tree_that_is_not_installed_has_no_version(capsys, monkeypatch):
    monkeypatch.setattr("importlib.metadata.Distribution.from_name", missing)
    assert status("--version") == 0 and capsys.readouterr().out.startswith("neuralocks of a source tree")


def missing(name):
    raise PackageNotFoundError(name)


def test_inspect_tells_what_a_shot_holds(tmp_path, capsys):
    shot = write_shot(tmp_path, Recipe(unit=0.01, up="Z", bound="mesh"))
    assert status("inspect", shot, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["unit [m]"], facts["up axis"], facts["rate [1/s]"], facts["frames"]) == (0.01, "Z", 24.0, [1.0, 9.0])
    rig, groom = facts["skeletons"][0], facts["grooms"][0]
    assert rig["head"].endswith("head") and abs(rig["head width [m]"] - 0.2) < 0.01 and rig["joints"] == 8
    assert rig["joint names"][3] == "hips/spine/neck/head"
    assert groom["strands"] == 40 and "Skin" in groom["carried by"] and facts["stops"] == []
    assert groom["shipped model"] == bake(shot, tmp_path / "out.usdc").grooms[0]["model"]
    assert status("inspect", shot) == 0
    text = capsys.readouterr().out
    assert "head width [m]: 0.2" in text and "joint names: hips, spine, neck, head, arm_L" in text


@pytest.mark.parametrize("path", [model_file.shipped(), *model_file.specialists()], ids=lambda path: path.stem)
def test_inspect_tells_of_a_model_what_a_person_reads(path, capsys):
    assert status("inspect", path) == 0
    text = capsys.readouterr().out
    assert "inputs of the body" in text and text.count("\n") < 150  # the curve alone has 200 points
    assert "trainings before this one: " in text and "began with:" not in text
    assert (" hair: " in text) == (path in model_file.specialists()) and max(map(len, text.splitlines())) < 1500


def test_inspect_tells_of_a_model_that_moves_hair_worse_than_not_at_all(tmp_path, capsys):
    for motion, told in ((1.3, 1), (0.9, 0)):
        path = write_random_model(tmp_path / "m.neuralocks", 1.0)
        file = model_file.read(path)
        model_file.write(path, {**file.meta, "report": {"held out": {"motion": motion}}}, file.graphs)
        assert status("inspect", path) == 0
        assert capsys.readouterr().out.count("its motion error on motion that it never saw is 1.30") == told


def test_memory_that_torch_lacks_is_one_line(capsys):
    """It has no MemoryError."""

    def failing(error):
        def fill() -> None:
            """Fill memory."""
            raise error

        return command_of(typer.Typer())("fill", usd=False)(fill)

    on_device = type("OutOfMemoryError", (RuntimeError,), {})("CUDA out of memory")
    for error in (RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried to allocate 9"), on_device):
        with pytest.raises(typer.Exit):
            failing(error)()
        assert capsys.readouterr().err.startswith("error: not enough memory; work on fewer strands")
    with pytest.raises(RuntimeError, match="another"):
        failing(RuntimeError("another"))()


def test_a_wrong_unit_is_noticed(tmp_path):
    from pxr import Usd, UsdGeom

    shot = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(shot))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    stage.GetRootLayer().Save()
    assert any("metersPerUnit" in line for line in inspect(shot)["spoils"])


def test_help_comes_without_the_heavy_parts():
    heavy = ("pxr", "numpy", "onnxruntime", "torch")
    code = f"import sys; from usd.cli.app import app; print([m for m in {heavy} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
    words = [sys.executable, "-m", "usd", "--help"]
    assert "bake" in subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def test_the_runtime_imports_only_what_inference_needs():
    """A start in half a second needs few imports: no training, drawing or statistics."""
    absent = ("torch", "warp", "onnx", "bpy", "trimesh", "moderngl", "matplotlib", "PIL", "pandas", "sympy",
              "scipy.stats", "scipy.signal", "scipy.ndimage", "scipy.integrate")  # fmt: skip
    code = f"import sys; import %s; print([m for m in {absent} if m in sys.modules])"
    for module in (
        "neuralocks_core.models.runtime, neuralocks_core.deformation.resolve",
        "usd.baking.bake, usd.baking.points.posing, usd.shot.stage",
    ):
        command = [sys.executable, "-c", code % module]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]", module


def test_a_bake_needs_no_torch(tmp_path, model):
    shot = write_shot(tmp_path)
    code = (
        "import sys\n"
        "class Absent:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in ('torch', 'warp', 'bpy', 'onnx'): raise ModuleNotFoundError(name)\n"
        "sys.meta_path.insert(0, Absent())\n"
        f"from usd.baking.bake import bake; bake({str(shot)!r}, {str(tmp_path / 'a.usdc')!r}, {str(model)!r}, frames='1:2')"
    )
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
    assert (tmp_path / "a.usdc").exists()


@pytest.mark.skipif(not GROOMS.exists(), reason="../shared/data/grooms is not there")
def test_a_hair_file_becomes_a_usd_groom(tmp_path, capsys):
    import numpy as np
    from pxr import Usd, UsdGeom, UsdValidation

    file = GROOMS / "mohawk" / "ratboy_mohawk.tfx"
    assert status("import", file, "-o", tmp_path / "groom.usdc", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    stage = Usd.Stage.Open(str(tmp_path / "groom.usdc"))
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    assert [e.GetMessage() for e in context.Validate(stage)] == []
    prim = next(p for p in stage.Traverse() if p.IsA(UsdGeom.BasisCurves))
    counts = UsdGeom.BasisCurves(prim).GetCurveVertexCountsAttr().Get()
    assert len(counts) == told["grooms"][0]["strands"] == 2228 and sum(counts) == told["grooms"][0]["vertices"]
    uv = UsdGeom.PrimvarsAPI(prim).GetPrimvar("groom_root_uv")
    assert uv.GetInterpolation() == "uniform" and len(uv.Get()) == 2228
    # And once more through USD: nothing changes except the file.
    again, _ = import_groom(tmp_path / "groom.usdc", tmp_path / "again.usda")
    points = np.asarray(UsdGeom.BasisCurves(prim).GetPointsAttr().Get())
    assert np.array_equal(again[0].points, points)
    assert write_groom(tmp_path / "third.usda", again[0]).exists()
