# SPDX-License-Identifier: Apache-2.0
"""`neuralocks export`: a model as plain ONNX files, whole or not at all."""

import json
import signal
from contextlib import suppress
from pathlib import Path

from pxr import Usd, UsdSkel

from neuralocks_core.models import model_file
from usd.border.stopping import INTERRUPTED

from ..commands import status
from ..shots import write_shot


def test_plain_onnx_with_its_description(tmp_path, model, capsys):
    """For the shipped model, if none is named."""
    import onnxruntime

    assert status("export", "-o", tmp_path) == 0
    told = capsys.readouterr().out.split()
    text = (tmp_path / "description.json").read_text()
    description = json.loads(text)
    assert len(told) == 5 and {Path(line).name for line in told} >= {"description.json", *description["graphs"]}
    assert len(text) < 22_000 and "curve" not in description["model"]["training"]
    for name, graph in description["graphs"].items():
        assert (tmp_path / name).read_bytes() == model_file.read(model_file.shipped()).graphs[name]
        session = onnxruntime.InferenceSession(tmp_path / name, providers=["CPUExecutionProvider"])
        assert [i.name for i in session.get_inputs()] == list(graph["inputs"])
    assert "of its last m samples only the first stays" in text, "what a bake does where a stop meets held poses"
    assert description["boundary vector"]["length"] == description["graphs"]["frame.onnx"]["inputs"]["frame"][1]
    assert status("export", model, "-o", tmp_path) == 0, "its own files are replaced"
    assert (tmp_path / "tail.onnx").read_bytes() == model_file.read(model).graphs["tail.onnx"]
    assert status("export", "-o", tmp_path, "--groom", "/Hair") == 1 and "--shot" in capsys.readouterr().err


def test_nothing_of_an_earlier_export_is_left_beside_other_graphs(tmp_path, model, capsys):
    """Tables made for another model fit these, and give other hair."""
    shot, out = write_shot(tmp_path), tmp_path / "out"
    assert status("export", model, "-o", out, "--shot", shot) == 0
    (out / "mine.npz").write_text("mine")
    told = json.loads((out / "description.json").read_text())
    assert list(told["grooms"]["files"]) == ["Hero_Hair.npz"]
    told["grooms"]["files"] |= {"../shot.npz": {}, "notes.txt": {}}  # a forged one
    for other in (tmp_path / "shot.npz", out / "notes.txt"):
        other.write_text("mine")
    (out / "description.json").write_text(json.dumps(told))
    assert status("export", model_file.shipped("rig"), "-o", out) == 0
    assert sorted(path.name for path in out.iterdir()) == ["description.json", "mine.npz", "notes.txt", "rig.onnx"]
    assert (tmp_path / "shot.npz").exists()


def test_names_that_no_file_has_in_an_earlier_description_are_passed_over(tmp_path, model):
    names = "\0.onnx", "\ud800.onnx", f"{'long' * 99}.onnx", "old.onnx"
    told = json.dumps({"units": 0, "model": 0, "graphs": dict.fromkeys(names, 0)})
    (tmp_path / "description.json").write_text(told)
    (tmp_path / "old.onnx").write_bytes(b"old")
    assert status("export", model, "-o", tmp_path) == 0
    assert not (tmp_path / "old.onnx").exists()


def test_a_failed_export_leaves_no_part_of_a_file(tmp_path, model, monkeypatch, capsys):
    shot, written, write = write_shot(tmp_path), [], Path.write_bytes

    def full(self, data):
        if len(written) == 2:
            raise OSError(28, "No space left on device")
        written.append(self)
        return write(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    assert status("export", model, "-o", tmp_path / "onnx", "--shot", shot) == 1
    assert "no space left" in capsys.readouterr().err
    assert len(written) == 2 and list(tmp_path.iterdir()) == [shot]


def test_a_graph_of_something_else_is_not_written_over(tmp_path, capsys):
    """An earlier export may be overwritten."""
    (tmp_path / "tail.onnx").write_text("mine")
    assert status("export", "-o", tmp_path) == 1
    assert "tail.onnx: belongs to something else" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["tail.onnx"] and (
        tmp_path / "tail.onnx"
    ).read_text() == "mine"
    (tmp_path / "tail.onnx").unlink()
    for _ in range(2):
        assert status("export", "-o", tmp_path) == 0


def test_nor_is_what_lies_beside_an_earlier_export(tmp_path, model, capsys):
    """Only what its description tells of is its own."""
    shot = write_shot(tmp_path)
    out, mine = tmp_path / "out", tmp_path / "out/Hero_Hair.npz"
    assert status("export", model, "-o", out) == 0
    mine.write_text("mine")
    before = {path: path.read_bytes() for path in out.iterdir()}
    assert status("export", model, "-o", out, "--shot", shot) == 1
    assert "Hero_Hair.npz: belongs to something else; move it" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in out.iterdir()} == before
    mine.unlink()
    for _ in range(2):
        capsys.readouterr()
        assert status("export", model, "-o", out, "--shot", shot) == 0
        assert sorted(capsys.readouterr().out.split()) == sorted(map(str, out.iterdir())) and mine.exists()


def test_who_stops_while_the_last_file_is_written_gets_none(tmp_path, model, monkeypatch):
    def swallowed(text):
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        return text

    monkeypatch.setattr("usd.models.export.readable", swallowed)
    monkeypatch.setattr("usd.models.export.plain", str)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job is deaf to it
    try:
        assert status("export", model, "-o", tmp_path / "out") == INTERRUPTED
    finally:
        signal.signal(signal.SIGINT, before)
    assert not list(tmp_path.iterdir())


def test_grooms_of_a_shot_without_animation_are_exported(tmp_path, model):
    """An engine may have motion of its own."""
    shot, out = write_shot(tmp_path), tmp_path / "out"
    stage = Usd.Stage.Open(str(shot))
    for prim in stage.Traverse():
        if prim.IsA(UsdSkel.Animation):
            prim.SetActive(False)
    stage.Save()
    assert status("export", model, "-o", out, "--shot", shot) == 0 and (out / "Hero_Hair.npz").exists()


def test_a_description_of_something_else_is_not_written_over(tmp_path, capsys):
    for text in ('{"units": 1}', "notes"):
        (tmp_path / "description.json").write_text(text)
        assert status("export", "-o", tmp_path) == 1
        assert "description.json: belongs to something else" in capsys.readouterr().err
        assert [path.name for path in tmp_path.iterdir()] == ["description.json"]
        assert (tmp_path / "description.json").read_text() == text


def test_a_graph_that_cannot_be_loaded_is_one_line_from_every_command(tmp_path, model, capsys):
    file = model_file.read(model)
    bad = model_file.write(tmp_path / "bad.neuralocks", file.meta, file.graphs | {"tail.onnx": b"nonsense"})
    for words in (("export", bad, "-o", tmp_path / "onnx"), ("inspect", bad)):
        assert status(*words) == 1
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and "bad.neuralocks: tail.onnx cannot be loaded" in error
