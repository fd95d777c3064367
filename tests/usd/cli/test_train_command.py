# SPDX-License-Identifier: Apache-2.0
"""The command `train`: what it refuses before anything is read, and what it tells when it is done."""

import json

import pytest

from neuralocks_core.models import model_file

from ...strand_models import write_random_model
from ..commands import status


def test_so_many_variations_as_fit_into_memory(capsys):
    words = ("train", "--character", "c.usda", "--groom", "library", "-o", "m.neuralocks", "--variations", "51")
    assert status(*words) == 2
    assert "--variations" in capsys.readouterr().err


def test_how_often_gestures_are_made_is_told_by_number(capsys):
    words = ("train", "--character", "c.usda", "-o", "m.neuralocks", "--gesture")
    for given, fact in (("bow=many", "--gesture bow=many: is not NAME=NUMBER"), ("bow", "--gesture bow: is not")):
        assert status(*words, given) == 1
        assert fact in capsys.readouterr().err


def test_help_tells_what_a_training_begins_with_where_nothing_is_said(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    assert status("train", "--help") == 0
    assert "[default: (shipped, where it fits)]" in capsys.readouterr().out


def test_training_methods_and_settings_are_checked_before_anything_is_read(tmp_path, capsys):
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    out = tmp_path / "m.neuralocks"
    selfsupervised = ("--method", "selfsupervised")
    for words, said in (
        (("--method", "magic"), "selfsupervised"),
        (("--paper",), "--method"),
        (("--minutes", "0"), "--minutes"),
        (("--minutes", "nan"), "--minutes"),
        (("--steps", "-1"), "--steps"),
        (("--rollouts", "0"), "--rollouts"),
        ((*selfsupervised, "--set", "colour=red"), "undetached"),
        ((*selfsupervised, "--set", "form=round"), "constant"),
        ((*selfsupervised, "--set", "rate=nan"), "rate"),
        ((*selfsupervised, "--set", "style=(0.0,)"), "style=(0.0,): is not a value for it; give numbers with commas"),
        ((*selfsupervised, "--set", "style=1,nan"), "like 0.0,1.0"),
        ((*selfsupervised, "--set", "style=1,inf"), "style=1,inf: is not a value"),
        (("--set", "minutes=-5"), "--minutes"),
        (("--set", "rate=-1"), "rate"),
        (("--set", "clips=0"), "clips"),
        (("--set", "clips=many"), "--set clips=many: is not a value for it; give something like 48"),
        (("--set", "clips=10000000"), "clips=10000000: must be at most 10,000"),
        ((*selfsupervised, "--set", "poses=100000000"), "poses=100000000: must be at most 10,000"),
        (("--set", "mirror=5"), "mirror=5"),
        (("--set", "steps=ten"), "--set steps=ten: is not a value for it; give a whole number"),
        ((*selfsupervised, "--set", "warmup=1.5"), "warmup=1.5"),
        (("--set", "motion=magic"), "modulated"),
        (("--set", "seed=-1"), "--seed"),
        (("--processes", "100000"), "at most 256"),
        (("--device", "abacus"), "--device abacus"),
    ):
        assert status("train", "--character", tmp_path / "nope.usda", "-o", out, *words) == 1
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and said in error and "nope" not in error


def test_settings_are_words_for_fields():
    pytest.importorskip("torch", reason="the extra 'train' is not installed")
    from neuralocks_core.physics.bend_twist import Cosserat
    from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
    from usd.models.train import parsed

    words = {"form": "direct", "paper_adhesion": "yes", "style": "1,2.5", "poses": "4", "rate": "1e-4", "steps": "7"}
    values = parsed(SelfSupervisedOptions, words)
    assert values == {
        "form": Cosserat.DIRECT, "paper_adhesion": True, "style": (1.0, 2.5), "poses": 4, "rate": 1e-4, "steps": 7
    }  # fmt: skip
    assert SelfSupervisedOptions.paper(**values).output == "displacement"


def test_what_was_reached_is_told(tmp_path, capsys, monkeypatch):
    """In one line, compared with rigid hair and the model that it began with; in full for machines."""
    pytest.importorskip("warp", reason="the extra 'train' is not installed")
    plain = model_file.read(write_random_model(tmp_path / "plain.neuralocks", 1.0))
    held = {"motion": 0.314, "motion_ratio": 0.91, "position": 2.13, "rigid": 9.9}
    training = {"steps": 1204, "minutes": 2.0, "strands held out": [400]}

    def train(character, grooms, motion, out, settings, **others):
        return model_file.write(out, {**plain.meta, "report": report, "training": training}, plain.graphs)

    monkeypatch.setattr("usd.models.train.train", train)
    words = ("train", "--character", "c.usda", "-o", tmp_path / "m.neuralocks")
    for before, told, kept, unseen in (
        ({}, "1)", [400], "motion and strands"),
        (
            {"held out, begun with": {"motion": 0.35}},
            "1, the model that it began with 0.35)",
            [400],
            "motion and strands",
        ),
        ({}, "1)", [400, 0], "motion"),  # too few locks to hold any back
    ):
        report, training["strands held out"] = {"held out": held, **before}, kept
        assert status(*words) == 0
        lines = capsys.readouterr().out.splitlines()
        assert lines == [
            f"{tmp_path}/m.neuralocks: 1,204 steps in 2 min",
            f"on {unseen} that it never saw: motion error 0.31 (hair carried rigidly {told}, motion 91% of the "
            "solver's, position 2.1 % of strand length off (rigidly 9.9 %)",
        ]
    assert status(*words, "--json") == 0
    assert json.loads(capsys.readouterr().out) == {
        "path": f"{tmp_path}/m.neuralocks", "training": training, "report": report
    }  # fmt: skip
