# SPDX-License-Identifier: Apache-2.0
"""Which Blenders the add-on's scenarios run in: those that were asked for, or none at all."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from . import blenders

ROOT = Path(__file__).parents[1]


@pytest.fixture
def only_4_5(monkeypatch, tmp_path):
    """Blender 4.5 is installed, 5.0 half, nothing else."""
    for name in ("4.5", "5.0"):
        (tmp_path / f".venv-blender-{name}").mkdir()
    (tmp_path / ".venv-blender-4.5/installed").touch()
    monkeypatch.setattr(blenders, "ROOT", tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))


def test_by_default_the_oldest_and_the_newest_are_tested_or_skipped(monkeypatch, only_4_5):
    for nothing in (None, ""):
        monkeypatch.delenv("NEURALOCKS_BLENDERS", raising=False)
        if nothing is not None:
            monkeypatch.setenv("NEURALOCKS_BLENDERS", nothing)
        assert blenders.asked_for() == ["4.2", "5.2"]
    with pytest.raises(pytest.skip.Exception, match=r"Blender 5.2 is not installed .*make blender"):
        blenders.python_of("5.2")


def test_what_is_asked_for_and_installed_is_tested(monkeypatch, only_4_5):
    monkeypatch.setenv("NEURALOCKS_BLENDERS", "4.5")
    assert blenders.asked_for() == ["4.5"] and blenders.python_of("4.5").parts[-3] == ".venv-blender-4.5"


def test_all_are_those_that_make_installs_and_the_program_if_it_is_there(monkeypatch, only_4_5):
    monkeypatch.setattr(blenders, "VERSIONS", ("4.5",))
    monkeypatch.setenv("NEURALOCKS_BLENDERS", "all")
    assert blenders.asked_for() == ["4.5", "3.4"] and "install Blender 3.4" in blenders.lacking("3.4")


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ("4.5,5.0", r"Blender 5.0 is not installed as a Python module \(make matrix installs it\)$"),
        ("4.2", "make blender installs it"),
        ("4.9", "Blender 4.9 .*choose among 3.4, 4.2, 4.5, 5.0, 5.2"),
        ("3.4", "install Blender 3.4"),
        ("all", "Blender 4.2 .*Blender 5.0 .*Blender 5.2 "),
    ],
)
def test_what_is_asked_for_and_not_installed_is_an_error_with_its_remedy(monkeypatch, only_4_5, asked, words):
    monkeypatch.setenv("NEURALOCKS_BLENDERS", asked)
    with pytest.raises(pytest.fail.Exception, match=words) as error:
        blenders.asked_for()
    assert "4.5 is not" not in str(error.value)


def test_make_matrix_installs_every_version():
    """Each by a rule of its own."""
    text = (ROOT / "Makefile").read_text("utf-8")
    assert sorted(re.findall(r"^\.venv-blender-([\d.]+)/installed:", text, re.M)) == sorted(blenders.VERSIONS)
    wanted = re.findall(
        r"\.venv-blender-([\d.]+)/installed", "".join(re.findall(r"^(?:blender|matrix):.*", text, re.M))
    )
    assert sorted(wanted) == sorted(blenders.VERSIONS)


def test_a_run_that_tests_nothing_of_what_was_asked_for_fails_in_one_line():
    words = [sys.executable, "-m", "pytest", "-q", "tests/blender/test_blender.py"]
    asked = os.environ | {"NEURALOCKS_BLENDERS": "4.9"}
    done = subprocess.run(words, cwd=ROOT, env=asked, capture_output=True, text=True, timeout=120)
    assert done.returncode == 2 and "NEURALOCKS_BLENDERS=4.9: Blender 4.9 is not installed" in done.stdout
    assert "skipped" not in done.stdout and "Traceback" not in done.stdout
