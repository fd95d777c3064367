# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts of the panel, broken where their letters end."""

import pytest

from dcc_addon.services.panel.wrapping import wrapped


def measure(text: str) -> float:
    """Narrow and wide letters, as in a font: a Japanese letter is twice as wide as a Latin one."""
    return sum(0.4 if letter in "il.,: \u00a0" else 2.0 if ord(letter) > 0x2E80 else 1.0 for letter in text)


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("", [""]),
        ("hair", ["hair"]),
        ("illi illi illi illi", ["illi illi illi illi"]),
        ("hhhh hhhh hhhh", ["hhhh hhhh", "hhhh"]),
        ("hhhh\n\n  hhhh\thhhh\n", ["hhhh hhhh", "hhhh"]),
        ("inside: 0.0095 %", ["inside:", "0.0095\u00a0%"]),
        ("stretched 5e-06 cm", ["stretched", "5e-06\u00a0cm"]),
        ("gives 10 mmmm", ["gives 10", "mmmm"]),
        ("a hhhhhhhhhhhhhhh b", ["a", "hhhhhhhhhhh", "hhhh b"]),
        ("\u9aea\u306e\u6bdb\u30a2\u30fc\u30de\u30c1\u30e5\u30a2 off", ["\u9aea\u306e\u6bdb\u30a2\u30fc", "\u30de\u30c1\u30e5\u30a2", "off"]),
    ],
)  # fmt: skip
def test_lines_are_as_long_as_fits(text, lines):
    found = wrapped(text, 11, measure)
    assert found == lines
    assert all(measure(line) <= 11 for line in found)
