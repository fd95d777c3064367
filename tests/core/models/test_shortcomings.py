# SPDX-License-Identifier: Apache-2.0
"""A model that learned too little is told; a report out of a forged file is no error."""

import re

import pytest

from neuralocks_core.models.shortcomings import shortcomings
from neuralocks_core.rig.network import RigModel

SPRINGS = {"spring bones, best of 12 settings": 0.78, "spring bones, VRM's defaults": 1.7}


@pytest.mark.parametrize(
    ("report", "told"),
    [
        ({"motion_error": {**SPRINGS, "dynamic network": 0.98}}, "is 0.98, where spring bones have 0.78"),
        ({"motion_error": {**SPRINGS, "dynamic network": 0.34}}, None),
        ({"motion_error": {"dynamic network": 1.2}}, "is 1.20, where hair carried rigidly has 1"),
        (
            {"tip_error_mm": {"network": 29.0, "rigid": 21.0, "optimised": 0.0}},
            "29 mm from where they would hang, .* 21 mm",
        ),
        ({"tip_error_mm": {"network": 56.0, "rigid": 127.0}}, None),
        ({"tip_error_mm": {"network": 0.0, "rigid": 0.0}}, None),
        ({"motion_error": 3, "tip_error_mm": [1]}, None),
        ({"motion_error": {"dynamic network": 10**400}, "tip_error_mm": {"network": 10**400, "rigid": 1}}, None),
        ({"motion_error": {"spring": "x", "dynamic network": "y"}, "tip_error_mm": {"network": None}}, None),
        ({}, None),
    ],
)
def test_of_a_rig(report, told):
    notes = shortcomings("a.neuralocks", "rig", report)
    assert len(notes) == (told is not None)
    if told:
        assert re.search(f"^a.neuralocks: .*{told}.*; train longer", notes[0])


def test_the_shipped_models_have_none():
    assert shortcomings("", "rig", RigModel.load(None).report) == []


@pytest.mark.parametrize(
    ("motion", "begun", "told"),
    [
        (0.3, 0.31, None),
        (0.31, 0.308, None),  # by chance
        (0.33, 0.3, "is 0.33, where the model that it began with has 0.30"),
        (1.2, 1.0, "is 1.20, where hair carried rigidly has 1"),
        (0.9, None, None),
    ],
)
def test_of_strands(motion, begun, told):
    report = {"held out": {"motion": motion}} | ({} if begun is None else {"held out, begun with": {"motion": begun}})
    assert [note.split("never saw ")[1].split(";")[0] for note in shortcomings("a", "strands", report)] == [
        told
    ] * bool(told)


_FORGED = [3, {"motion": "1.2"}, {"motion": True}, {"motion": 10**400}, {"motion": float("inf")}]


@pytest.mark.parametrize("report", [{"held out": each} for each in _FORGED])
def test_of_strands_with_a_forged_report(report):
    assert shortcomings("a.neuralocks", "strands", report) == []
