# SPDX-License-Identifier: Apache-2.0
"""Notes that are the same for many prims, such as the characters of a crowd, told once."""

import re
from collections.abc import Hashable, Iterable

_PATH = re.compile(r"(?<![\w.])/[\w/:.{}=-]*\w")
_FEW = 2
"""Up to so many texts of one kind stay apart."""
_NAMED = 8
"""So many prims are named."""


def without_paths(text: str) -> str:
    """A text with the same mark in place of each prim path."""
    return _PATH.sub("/", text)


def grouped(things: Iterable, key) -> list[list]:
    """Things whose keys are equal side by side, in the order of the first of each."""
    groups: dict[Hashable, list] = {}
    for thing in things:
        groups.setdefault(key(thing), []).append(thing)
    return list(groups.values())


def told_once(texts: Iterable[str]) -> list[str]:
    """Texts of which those that differ in nothing but prim paths are one, with these prims of the others, or the first and the
    last of many.
    """
    result = []
    for same in grouped(dict.fromkeys(texts), without_paths):
        if len(same) <= _FEW:
            result += same
            continue
        # In the first place where they differ: before it may stand a file that all of them tell of.
        columns = zip(*(_PATH.findall(text) for text in same), strict=True)
        _, *others = next(column for column in columns if len(set(column)) > 1)
        if len(others) > _NAMED:
            others[_NAMED - 2 : -1] = ["..."]
        result.append(f"{same[0]} (likewise {len(same) - 1} more: {', '.join(others)})")
    return result
