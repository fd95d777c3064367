# SPDX-License-Identifier: Apache-2.0
"""JSON that people and programs read."""

import json

from neuralocks_core.json_values import readable


def test_lists_of_numbers_stand_on_one_line_and_nothing_else_changes():
    value = {
        "m": [[1, -2.5e-07, 3], [4.0, 1e20, 6]],
        "words": ["[\\n 1, 2]", "[ 1 ]", "a"],
        "mixed": [1, "2"],
        "none": [],
        "x": 1,
    }
    text = readable(value)
    assert json.loads(text) == value
    assert "[1, -2.5e-07, 3]" in text and "[4.0, 1e+20, 6]" in text and len(text.splitlines()) == 17
