# SPDX-License-Identifier: GPL-3.0-or-later
"""What the process that trains for the panel asks for, and what it says meanwhile, without the training itself."""

import io
import json
import os
from pathlib import Path
from unittest.mock import create_autospec

import pytest

from dcc_addon.services.training import training_child
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.training.work_folder import folder_beside


@pytest.fixture
def child(monkeypatch, capsys, tmp_path):
    """Runs it with settings and a training (progress, tell, out) of theirs; returns its status, what it said, and the arguments."""
    pytest.importorskip("torch")
    from usd.models.train import train
    from usd.rig.train import train_rig

    def run(training, **settings):
        asked = {"character": "c.usdc", "out": str(tmp_path / "a.neuralocks"), "minutes": 4.0, "head": "spine/head"}
        monkeypatch.setattr("sys.stdin", io.StringIO(json.dumps(asked | settings)))
        given = {}

        def called(character, *args, progress, tell, **options):
            given.update(options, character=character)
            training(progress, tell, args[-2] if len(args) > 1 else args[0])

        monkeypatch.setattr("usd.models.train.train", create_autospec(train, side_effect=called))
        monkeypatch.setattr("usd.rig.train.train_rig", create_autospec(train_rig, side_effect=called))
        status = training_child.main()
        return status, [json.loads(line) for line in capsys.readouterr().out.splitlines()], given

    return run


def test_strands_say_how_far_they_are_before_and_while_they_learn(child):
    def training(progress, tell, _out):
        progress(1, 4, "Simulating")
        tell(["it has no neck"])
        progress(250, 1000, "Learning")

    status, said, given = child(training, kind="strands")
    assert status == 0 and given["character"] == "c.usdc" and given["head"] == "spine/head"
    assert said == [
        {"done": 0, "message": "Reading the character"},
        {"done": 0, "message": "Simulating"},
        {"before": 0.25},
        {"notes": ["it has no neck"]},
        {"done": 0.25, "message": "Learning"},
    ]


@pytest.mark.parametrize(("minutes", "rollouts"), [(0.05, 24), (4, 320), (720, 4000)])
def test_strands_get_the_simulations_that_their_time_allows(child, minutes, rollouts):
    assert child(lambda *_: None, kind="strands", minutes=minutes)[2]["rollouts"] == rollouts


@pytest.mark.parametrize(("minutes", "seconds"), [(0.25, 15), (2, 30), (4, 140)])
def test_bones_learn_in_what_simulations_and_report_leave_of_the_time(child, minutes, seconds):
    _, said, given = child(lambda progress, *_: progress(1, 2, "b"), kind="rig", minutes=minutes, chains=["a", "b*"])
    assert given["seconds"] == seconds and given["chains"] == ["a", "b*"] and said[-1] == {"done": 0.5, "message": "b"}
    assert child(lambda *_: None, kind="rig", chains=[])[2]["chains"] is None


def test_what_a_user_can_fix_is_said_and_nothing_is_left(child, tmp_path):
    def training(_progress, _tell, out):
        folder_beside(Path(out)).mkdir()
        raise NeuralocksError("/Hair: has no strands; add some")

    status, said, _ = child(training, kind="strands")
    assert status == 1 and said[-1] == {"error": "/Hair: has no strands; add some"}
    assert not list(tmp_path.iterdir())


def test_it_ends_with_blender(child, monkeypatch):
    def training(progress, *_):
        monkeypatch.setattr(os, "getppid", lambda: -1)
        progress(1, 2, "nobody hears this")

    with pytest.raises(SystemExit, match="1"):
        child(training, kind="rig")
