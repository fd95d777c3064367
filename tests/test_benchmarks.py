# SPDX-License-Identifier: Apache-2.0
"""Benchmarks say in words what they lack."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

from neuralocks_core.errors import NeuralocksError


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            ModuleNotFoundError("No module named 'trimesh'", name="trimesh"),
            'trimesh: is not installed; pip install ".[test]"',
        ),
        (NeuralocksError("no.bvh: no such file"), "no.bvh: no such file"),
    ],
)
def test_a_missing_extra_is_told_without_a_traceback(error, said, monkeypatch, capsys):
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    monkeypatch.setattr(sys, "argv", ["benchmarks/reference_speed.py"])
    import_module("plain_errors").told(type(error), error, None)
    assert capsys.readouterr().err == f"reference_speed: {said}\n"


def test_other_errors_keep_their_traceback(monkeypatch, capsys):
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "benchmarks")
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)
    import_module("plain_errors").told(ModuleNotFoundError, ModuleNotFoundError("no numpy", name="numpy"), None)
    assert "ModuleNotFoundError: no numpy" in capsys.readouterr().err
