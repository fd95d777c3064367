# SPDX-License-Identifier: Apache-2.0
"""What a rig bake is given and tells: options that it refuses before it writes, and all its notes."""

import pytest
from pxr import Sdf

from neuralocks_core.errors import NeuralocksError
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import model_for, small_shot


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"out": "hair.txt"}, "hair.txt: is written as a USD layer; end its name with .usd"),
        ({"out": "shot.usda"}, "shot.usda: is read"),
        ({"strength": 2.5}, "--strength 2.5: must be a number from 0 to 2"),
        ({"subframes": 0}, "subframes"),
        ({"head": "nose"}, "nose"),
        ({"skeleton": "/Who/Hair"}, "/Who/Hair"),
    ],
)
def test_what_no_bake_can_use_is_refused_and_nothing_is_written(tmp_path, options, words):
    shot = small_shot(tmp_path / "shot.usda")
    model, before = model_for(read_rigged_hair(shot)), shot.read_bytes()
    out = tmp_path / {"out": "hair.usda", **options}["out"]
    with pytest.raises(NeuralocksError, match=words):
        bake_rig(shot, out, model, **{name: value for name, value in options.items() if name != "out"})
    assert [each.name for each in tmp_path.iterdir()] == ["shot.usda"] and shot.read_bytes() == before


def test_joints_of_another_type_than_names_are_told(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    model, layer = model_for(read_rigged_hair(shot)), Sdf.Layer.FindOrOpen(str(shot))
    rig = layer.GetPrimAtPath("/Who/Rig")
    rig.RemoveProperty(rig.attributes["joints"])
    Sdf.AttributeSpec(rig, "joints", Sdf.ValueTypeNames.Float).default = 1.0
    layer.Save()
    with pytest.raises(NeuralocksError, match=r"/Who/Rig: its joints are float, not token\[\]; export it again"):
        bake_rig(shot, tmp_path / "hair.usda", model)


def test_all_notes_are_told_those_known_before_hair_is_turned_first(tmp_path):
    """And how many samples are done."""
    for folder in ("layout", "cache"):
        (tmp_path / folder).mkdir()
    model, told = model_for(read_rigged_hair(small_shot(tmp_path / "who.usda"))), []
    (tmp_path / "layout" / "set.usda").write_text('#usda 1.0\ndef "Who" (references = @who.usda@</Who>)\n{\n}\n')
    shot = tmp_path / "shot.usda"
    shot.write_text("#usda 1.0\n(\n  metersPerUnit = 1\n  subLayers = [@./layout/set.usda@]\n)\n")
    out, done = tmp_path / "cache" / "hair.usda", []
    result = bake_rig(shot, out, model, tell=told.append, progress=lambda *each: done.append(each))
    first, late = told
    assert first and any("SEARCH_PATH" in note for note in late) and result.notes == first + late
    assert done == [(number, 25, "hair joints") for number in range(1, 26)]
