# SPDX-License-Identifier: Apache-2.0
"""What is the same of many prims, such as the characters of a crowd, told once."""

import re
from collections.abc import Hashable, Iterable

_PATH = re.compile(r"(?<![\w.])/[\w/:.{}=-]*\w")
_FEW = 2
"""Up to so many texts of one kind stay apart: who reads them sees each prim."""


def without_paths(text: str) -> str:
    """A text with the same mark in place of each prim path."""
    return _PATH.sub("/", text)


def first_path(text: str) -> str:
    """The first prim path in a text, empty where there is none."""
    found = _PATH.search(text)
    return found[0] if found else ""


def grouped(things: Iterable, key) -> list[list]:
    """Things whose keys are equal side by side, in the order of the first of each."""
    groups: dict[Hashable, list] = {}
    for thing in things:
        groups.setdefault(key(thing), []).append(thing)
    return list(groups.values())


def told_once(texts: Iterable[str]) -> list[str]:
    """Texts of which those that differ in nothing but prim paths are one, with how many more there are of them, and the
    first and last of these prims.
    """
    result = []
    for same in grouped(dict.fromkeys(texts), without_paths):
        others = [first_path(text) for text in same[1:]]
        if len(same) <= _FEW or not all(others):
            result += same
        else:
            result.append(f"{same[0]} (likewise {len(others)} more, {others[0]} to {others[-1]})")
    return result
