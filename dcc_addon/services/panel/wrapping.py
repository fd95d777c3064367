# SPDX-License-Identifier: GPL-3.0-or-later
"""Text wrapped by the drawn width of its letters, since widths differ by half, and more in other scripts."""

import re
from collections.abc import Callable

_UNIT = re.compile(r"(?<=\d) (?=(?:%|[cm]?m(?:/s)?|s|deg|degrees|J/kg)(?!\w))")
"""The space between a number and its unit."""
_SPACE = re.compile(r"[ \t\n\r\f\v]+")
"""Where lines may be broken: an error from elsewhere may have line breaks, which a label does not draw."""


def wrapped(text: str, width: float, measure: Callable[[str], float]) -> list[str]:
    """Lines of a text, at least one, none wider than `width` as `measure` gives it; broken at spaces, or within a word that is too
    wide. A number keeps its unit.
    """
    lines, line = [], ""
    for word in _SPACE.split(_UNIT.sub("\u00a0", text)):
        if not word:
            continue
        if line and measure(f"{line} {word}") <= width:
            line = f"{line} {word}"
            continue
        if line:
            lines.append(line)
        while len(word) > 1 and measure(word) > width:
            fits = next((n for n in range(len(word) - 1, 1, -1) if measure(word[:n]) <= width), 1)
            lines.append(word[:fits])
            word = word[fits:]
        line = word
    return [*lines, line] if line or not lines else lines
