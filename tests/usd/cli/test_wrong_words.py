# SPDX-License-Identifier: Apache-2.0
"""Words of a command that cannot be meant are refused in one line, before any work."""

import os

import pytest

from neuralocks_core.models import model_file
from usd.cli.command import one_line, say

from ..commands import status
from ..shots import write_shot


def test_errors_are_one_line_and_status_one(tmp_path, model, capsys):
    for words in (
        ("bake", tmp_path / "nope.usda", "-o", tmp_path / "a.usdc", "--model", model),
        ("inspect", tmp_path / "nope.usda"),
        ("import", tmp_path / "nope.tfx", "-o", tmp_path / "a.usdc"),
        ("export", tmp_path / "nope.neuralocks", "-o", tmp_path),
    ):
        assert status(*words) == 1
        captured = capsys.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1 and captured.err.startswith("error: "), captured
        assert "nope" in captured.err


def test_what_names_from_files_hold_does_not_reach_the_terminal(capsys):
    one_line("error: joint '\x1b[31mred\x07' is\nmissing: \u00e9")
    assert capsys.readouterr().err == "error: joint '?[31mred?' is missing: \u00e9\n"
    one_line("a" * 10_000_000)
    assert len(capsys.readouterr().err) < 20_000
    say("joints\n  \x1b[31mred\x07: \u00e9")
    assert capsys.readouterr().out == "joints\n  ?[31mred?: \u00e9\n"


def test_results_show_what_files_say_without_what_steers_a_terminal(tmp_path, model, capsys):
    told = model_file.read(model)
    forged = model_file.write(tmp_path / "forged.neuralocks", {**told.meta, "credits": ["by \x1b[2Jme"]}, told.graphs)
    assert status("inspect", forged) == 0
    out = capsys.readouterr().out
    assert "by ?[2Jme" in out and "\x1b" not in out


def test_names_that_are_no_text_are_refused_in_one_line(tmp_path, model, capsys):
    odd = tmp_path / os.fsdecode(b"sh\xff.usda")
    try:
        write_shot(tmp_path).rename(odd)
    except (OSError, UnicodeError):
        pytest.skip("this disk takes only text")
    for words in (
        ("bake", odd, "-o", tmp_path / "a.usdc", "--model", model),
        ("inspect", odd),
        ("train", "--character", odd, "-o", tmp_path / "a.neuralocks"),
        ("rig", "export-c", "-o", odd.with_suffix(".h")),
    ):
        assert status(*words) == 1
        captured = capsys.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1 and "not UTF-8" in captured.err, captured


def test_a_folder_whose_name_is_no_text_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    """Also for a file in the current folder, because USD asks for its whole path."""
    odd = tmp_path / os.fsdecode(b"shots\xff")
    try:
        odd.mkdir()
        write_shot(tmp_path).rename(odd / "shot.usda")
        monkeypatch.chdir(odd)
    except (OSError, UnicodeError):
        pytest.skip("this disk takes only text")
    for words in (("bake", "shot.usda", "-o", "a.usdc"), ("inspect", "shot.usda"), ("import", "a.tfx", "-o", "a.usda")):
        assert status(*words) == 1
        captured = capsys.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1 and "not UTF-8" in captured.err, captured
    assert status("rig", "export-c", "-o", "hair.h") == 0, "which needs no USD"


def test_an_empty_word_is_refused(tmp_path, capsys):
    """As an unset variable of a script leaves: otherwise `--head ""` would be like no --head."""
    for words in (
        ("bake", "s.usda", "-o", "o.usdc", "--head", ""),
        ("rig", "inspect", "s.usda", "--chains", " "),
        ("train", "--character", "c.usda", "-o", "m.neuralocks", "--set", ""),
    ):
        assert status(*words) == 1
        assert capsys.readouterr().err == f"error: {words[-2]}: is empty; give a value, or leave it out\n"
    assert status("grow", "", "--character", "c.usda", "-o", "o.usda") == 1
    assert capsys.readouterr().err.startswith("error: style: is empty")


def test_a_name_is_given_a_value_once(capsys):
    """Otherwise the last of two would win silently."""
    for words, name in (
        (("bake", "s.usda", "-o", "o.usdc", "--joint", "neck=a", "--joint", "neck=b"), "--joint neck=b: neck"),
        (("body", "-o", "o.usda", "--phenotype", "age=1", "--phenotype", "age=2"), "--phenotype age=2: age"),
    ):
        assert status(*words) == 1
        assert capsys.readouterr().err == f"error: {name} is given twice; give it once\n"


def test_an_empty_path_is_not_the_current_folder(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words, name, needed in (
        (("demo", "-o", ""), "--out", False),
        (("demo", "--out="), "--out", False),
        (("import", "a.hair", "-o", ""), "--out", True),
        (("bake", "", "-o", "o.usdc"), "shot", True),
        (("join", "a.usdc", "", "-o", "o.usdc"), "parts", True),
        (("evaluate", "a.usdc", "--plot", ""), "--plot", False),
    ):
        assert status(*words) == 1
        remedy = "give a value" if needed else "give a value, or leave it out"
        assert capsys.readouterr().err == f"error: {name}: is empty; {remedy}\n"
    assert not list(tmp_path.iterdir())


def test_a_value_may_end_in_an_equals_sign(capsys):
    assert status("bake", "s.usda", "--out=a=") == 1
    assert capsys.readouterr().err.startswith("error: a=: ")


def test_numbers_are_written_plainly(tmp_path, model, capsys):
    shot = write_shot(tmp_path)
    for words, fact in (
        (("--frames", "1:1_0"), "--frames 1:1_0: is not FIRST:LAST"),
        (("--cuts", "1_0"), "--cuts 1_0: is not a list of frames"),
        (("--material", "weight=\u0662"), "material 'weight=\u0662': no number"),
    ):
        assert status("bake", shot, "-o", tmp_path / "o.usdc", "--model", model, *words) == 1
        assert fact in capsys.readouterr().err


def test_a_plot_that_cannot_be_written_is_told_before_the_work(tmp_path, capsys):
    pytest.importorskip("matplotlib", reason="the extra 'compare' is not installed")
    (tmp_path / "file").touch()
    assert status("evaluate", tmp_path / "none.usdc", "--plot", tmp_path / "file" / "tips.png") == 1
    assert "tips.png: there is a file, not a folder, on the way" in capsys.readouterr().err
    (tmp_path / "tips.png").mkdir()
    assert status("evaluate", tmp_path / "none.usdc", "--plot", tmp_path / "tips.png") == 1
    assert capsys.readouterr().err == f"error: {tmp_path / 'tips.png'}: is a folder; give a file name\n"


def test_a_folder_where_a_file_is_to_be_is_told_before_the_work(tmp_path, capsys):
    (tmp_path / "model" / "rig.onnx").mkdir(parents=True)
    assert status("export", model_file.shipped("rig"), "-o", tmp_path / "model") == 1
    assert "rig.onnx: is a folder; move it" in capsys.readouterr().err
    assert os.listdir(tmp_path / "model") == ["rig.onnx"]


def test_a_seed_is_one_of_numpys(capsys):
    for words in (("grow", "bob"), ("train",), ("rig", "train", "c.usda")):
        assert status(*words, "--character", "c.usda", "-o", "o.usda", "--seed", "-1") == 2
    capsys.readouterr()


def test_wrong_usage_is_status_two(capsys):
    assert status("bake") == 2
    assert status("bake", "a.usd", "-o", "b.usdc", "--jobs", "many") == 2
    assert status("unknown") == 2


@pytest.mark.parametrize("size", ["640", "640x", "640x480x3", "1e2x100", "-5x9", "x"])
def test_a_size_that_is_no_width_and_height_is_refused(tmp_path, size, capsys):
    assert status("preview", tmp_path / "hair.usdc", "-o", tmp_path / "hair.png", "--size", size) == 1
    assert f"--size {size}: is not WIDTHxHEIGHT; write for example 640x480" in capsys.readouterr().err
