# SPDX-License-Identifier: Apache-2.0
"""When commands print what a user should know."""

import json

from usd.baking.posing import GroomPoser

from ..commands import status
from ..shots import Recipe, write_shot


def test_what_spoils_a_bake_is_told_once_before_hair_is_posed(tmp_path, model, capsys, monkeypatch):
    """Not after the minutes that it saves."""
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
