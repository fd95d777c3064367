# SPDX-License-Identifier: GPL-3.0-or-later
"""What a .blend file remembers for live hair may have been written by anybody."""

import json

import pytest

from dcc_addon.scene.remembered import remembered


def test_values_come_back_by_name():
    assert remembered(json.dumps({"Bone": ["XYZ", [0, 0, 0]]})) == {"Bone": ["XYZ", [0, 0, 0]]}
    assert remembered("") == {}


@pytest.mark.parametrize("text", ["{", "3", "[[1]]", '{"a": 3, "b": {"c": []}}', "[" * 100_000])
def test_anything_else_is_nothing(text):
    assert remembered(text) == {}
