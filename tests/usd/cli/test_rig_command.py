# SPDX-License-Identifier: Apache-2.0
"""`neuralocks rig`: which options arrive, and what is printed for people and for machines."""

import json
from pathlib import Path

import pytest
from pxr import Usd, UsdGeom

from usd.rig.stage import read_rigged_hair

from ..commands import status
from ..rig_shots import model_for, small_shot


def test_the_options_of_a_training_arrive_and_its_result_is_told(tmp_path, capsys, monkeypatch):
    shot = small_shot(tmp_path / "shot.usda")
    model, given = model_for(read_rigged_hair(shot)), {}
    model.training["steps"] = 1200

    def train_rig(character, out, **options):
        given.clear()
        given.update(options, character=character, out=out)
        return model

    monkeypatch.setattr("usd.rig.train.train_rig", train_rig)
    words = ("rig", "train", shot, "-o", tmp_path / "m.neuralocks")
    assert status(*words) == 0
    assert capsys.readouterr().out.startswith(f"{tmp_path}/m.neuralocks: 3 hair joints in 1 chain, 1200 steps\n")
    left_out = ("seconds", "steps", "begin", "hidden", "clips", "chains", "head", "skeleton")
    assert given["dynamic"] is True and given["early"] is True and given["material"] == {} and given["seed"] == 0
    assert all(given[name] is None for name in left_out) and not given["joints"] and given["tell"]
    numbers = "--seconds 3 --steps 4 --hidden 5 --clips 6 --seed 7 --stiffness 0.02 --weight 2 --damping 3".split()
    others = "--begin a.neuralocks --chains a* --chains b --head c --skeleton /D --joint neck=e --quasi-static".split()
    assert status(*words, *numbers, *others, "--json") == 0
    assert json.loads(capsys.readouterr().out) == {
        "path": f"{tmp_path}/m.neuralocks", "training": {"steps": 1200}, "report": model.report
    }  # fmt: skip
    wanted = {
        "character": shot, "out": tmp_path / "m.neuralocks", "seconds": 3, "steps": 4, "hidden": 5, "clips": 6, "seed": 7,
        "material": {"bend": 0.02, "weight": 2, "damping": 3}, "begin": Path("a.neuralocks"), "chains": ["a*", "b"],
        "head": "c", "skeleton": "/D", "joints": {"neck": "e"}, "dynamic": False, "early": True,
    }  # fmt: skip
    assert {name: given[name] for name in wanted} == wanted


def test_the_chains_of_a_rig_are_listed(tmp_path, capsys):
    """Lengths are those between the joints, in any unit."""
    shot = small_shot(tmp_path / "shot.usda", scale=100.0, z_up=True)
    assert status("rig", "inspect", shot) == 0
    said, notes = capsys.readouterr()
    assert said == "/Who/Rig: 3 hair joints in 1 chain\n  hair_0: 3 joints, 21.8 cm\n"
    assert notes.startswith("note: /Who/Rig: no joint found for neck;")
    assert status("rig", "inspect", shot, "--chains", "hair_1", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["skeleton"] == "/Who/Rig" and told["notes"]
    assert told["chains"] == [{"name": "hair_1", "joints": 2, "length [m]": pytest.approx(0.1456, abs=1e-4)}]
    assert status("rig", "inspect", shot, "--chains", "hair_1", "--chains", "tail") == 1
    assert "--chains tail: no joint of the hair has such a name" in capsys.readouterr().err


def test_how_many_characters_a_bake_moves_is_told(tmp_path, capsys):
    model = model_for(read_rigged_hair(small_shot(tmp_path / "shot.usda"))).save(tmp_path / "m.neuralocks")
    stage = Usd.Stage.CreateNew(str(tmp_path / "both.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name in ("One", "Two"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference("./shot.usda")
    stage.Save()
    words = ("rig", "bake", tmp_path / "both.usda", "-o", tmp_path / "out.usda", "--model", model, "--frames", "1:3")
    assert status(*words) == 0
    assert capsys.readouterr().out == (
        f"{tmp_path}/out.usda: 3 hair joints, 25 samples, in /One/Rig/NeuralocksHair, and 1 more character\n"
    )
