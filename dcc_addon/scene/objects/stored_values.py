# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scene remembers of things that were changed for live hair, as text in the file, which is not to be trusted."""

import json
from collections.abc import Callable, Sequence

LARGEST = 1e15
"""Numbers that Blender's single precision holds, squared too."""


def remembered(text: str, fits: Callable[[list], bool]) -> dict[str, list]:
    """Values by name, those that fit; none if the text holds something else."""
    try:
        found = json.loads(text or "{}")
    except (ValueError, TypeError, RecursionError):  # it may not be text at all, or hold a number too long to read
        return {}
    pairs = found.items() if isinstance(found, dict) else ()
    return {name: values for name, values in pairs if isinstance(values, list) and _is_name(name) and fits(values)}


def are_numbers(values, count: int) -> bool:
    """Whether these are `count` numbers that Blender can hold."""
    return isinstance(values, Sequence) and len(values) == count and all(map(_is_number, values))


def _is_name(text: str) -> bool:
    """Whether Blender can look this up."""
    return not any("\ud800" <= letter <= "\udfff" for letter in text)


def _is_number(value) -> bool:
    return type(value) in (int, float) and -LARGEST < value < LARGEST  # both are false for NaN
