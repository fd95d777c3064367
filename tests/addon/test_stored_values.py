# SPDX-License-Identifier: GPL-3.0-or-later
"""What a .blend file remembers for live hair may have been written by anybody."""

import json

import pytest

from dcc_addon.scene.objects.stored_values import are_numbers, remembered


def test_values_come_back_by_name_where_they_fit():
    text = json.dumps({"Bone": ["XYZ", [0, 0, 0]], "Other": [3]})
    assert remembered(text, len) == {"Bone": ["XYZ", [0, 0, 0]], "Other": [3]}
    assert remembered(text, lambda values: values[0] == "XYZ") == {"Bone": ["XYZ", [0, 0, 0]]}
    assert remembered("", len) == {}


@pytest.mark.parametrize(
    "text",
    ["{", "3", "[[1]]", '{"a": 3, "b": {"c": [1]}}', "[" * 100_000, "1" * 5_000, 3, b"\xff", r'{"\ud800": [1]}'],
)
def test_anything_else_is_nothing(text):
    assert remembered(text, lambda values: True) == {}


@pytest.mark.parametrize("text", ["[1, 2, 3]", "[1, 2.5, -3e14]"])
def test_numbers_are_what_blender_can_hold(text):
    assert are_numbers(json.loads(text), 3)


@pytest.mark.parametrize(
    "text", ["[1, 2]", "[1, 2, NaN]", "[1, 2, 1e300]", "[1, 2, true]", '[1, 2, "3"]', "3", '"123"']
)
def test_anything_else_is_no_numbers(text):
    assert not are_numbers(json.loads(text), 3)
