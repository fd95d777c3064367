# SPDX-License-Identifier: Apache-2.0
"""What is said of a character that lies in its bind pose, and of a stage that says neither axis nor unit."""

import pytest
from pxr import Usd, UsdGeom

from usd.review.inspect import inspect
from usd.shot.stage import read_shot

from ..shots import Recipe, write_shot

LIES = "/Hero/Rig: lies down in its bind pose"


def _said(path, words) -> list[str]:
    """The notes with these words, alike for a bake and for `inspect`."""
    noted, told = (
        [note for note in notes if words in note] for notes in (read_shot(path).notes, inspect(path)["spoils"])
    )
    assert noted == told
    return noted


def _without(path, name):
    stage = Usd.Stage.Open(str(path))
    stage.ClearMetadata(name)
    stage.Save()
    return path


@pytest.mark.parametrize("up, lying", [("Y", 0), ("Z", 1)])
def test_a_character_that_lies_by_a_stages_silence_is_told(tmp_path, up, lying):
    path = write_shot(tmp_path, Recipe(up=up))
    assert not _said(path, "lies down")
    said = _said(_without(path, "upAxis"), "lies down")
    assert len(said) == lying
    assert all(note.startswith(LIES) and "no upAxis, so Y is up: author it" in note for note in said)


def test_a_character_referenced_with_another_axis_is_told_until_it_is_turned(tmp_path):
    write_shot(tmp_path, Recipe(up="Z"), "asset")
    stage = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, "Y")
    stage.DefinePrim("/Hero").GetReferences().AddReference("./asset.usda")
    stage.Save()
    (said,) = _said(tmp_path / "shot.usda", "lies down")
    assert said.startswith(LIES) and "asset.usda has Z up, the stage Y" in said and "needs a transform" in said
    UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddRotateXOp().Set(-90.0)
    stage.Save()
    assert not _said(tmp_path / "shot.usda", "lies down")


def test_a_unit_that_no_layer_says_is_told(tmp_path):
    path = write_shot(tmp_path, Recipe(unit=0.01), "asset")
    shot = Usd.Stage.CreateNew(str(tmp_path / "shot.usda"))
    shot.GetRootLayer().subLayerPaths.append("./asset.usda")
    shot.Save()
    assert not _said(tmp_path / "shot.usda", "metersPerUnit"), "the one that counts is the one that is meant"
    assert len(_said(_without(path, "metersPerUnit"), "no metersPerUnit, so a unit counts as a centimetre")) == 1
