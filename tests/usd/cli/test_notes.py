# SPDX-License-Identifier: Apache-2.0
"""When commands print what a user should know."""

import json

from neuralocks_core.rig.carried import CarriedHair
from usd.baking.points.posing import GroomPoser
from usd.rig.stage import read_rigged_hair

from ..commands import status
from ..rig_shots import model_for, small_shot
from ..shots import Recipe, write_shot


def test_what_spoils_a_bake_is_told_once_before_hair_is_posed(tmp_path, model, capsys, monkeypatch):
    """Not after the minutes that the note could save."""
    shot, told, poser = write_shot(tmp_path, Recipe(unit=0.01, frames=1, strands=4)), [], GroomPoser.__init__
    shot.write_text(shot.read_text().replace("metersPerUnit = 0.01", "metersPerUnit = 1"))

    def begun(*args, **options):
        told.append(capsys.readouterr().err)
        poser(*args, **options)

    monkeypatch.setattr(GroomPoser, "__init__", begun)
    assert status("bake", shot, "-o", tmp_path / "a.usdc", "--model", model, "--json") == 0
    after = capsys.readouterr()
    assert "m wide; check the stage's metersPerUnit (1)" in told[0] and "one sample" in told[0] and after.err == ""
    assert told[0].splitlines() == [f"note: {text}" for text in json.loads(after.out)["notes"]]


def test_what_spoils_a_bake_of_bones_is_told_once_before_they_are_turned(tmp_path, capsys, monkeypatch):
    shot, told, turns = small_shot(tmp_path / "shot.usda"), [], CarriedHair.turns
    model = model_for(read_rigged_hair(shot)).save(tmp_path / "hair.neuralocks")

    def begun(*args, **options):
        told.append(capsys.readouterr().err)
        return turns(*args, **options)

    monkeypatch.setattr(CarriedHair, "turns", begun)
    words = (
        "rig",
        "bake",
        shot,
        "-o",
        tmp_path / "a.usdc",
        "--model",
        model,
        "--strength",
        "0.5",
        "--frames",
        "90:100",
    )
    assert status(*words, "--json") == 0
    after = capsys.readouterr()
    notes = [f"note: {text}" for text in json.loads(after.out)["notes"]]
    assert [line for line in told[0].splitlines() if line.startswith("note: ")] == notes and after.err == ""
    assert any("motion strength" in line for line in notes) and any(
        "none of it within 90 to 100" in line for line in notes
    )
