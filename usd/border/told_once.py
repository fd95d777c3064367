# SPDX-License-Identifier: Apache-2.0
"""Notes that are the same, or similar, for many prims, such as the characters of a crowd: told once, or a few of them."""

import re
from collections.abc import Hashable, Iterable

_PATH = re.compile(r"(?<![\w.])/[\w/:.{}=-]*\w")
_SEPARATE = 2
"""Up to this many texts that differ only in prim paths stay separate."""
_FEW = 3
"""Up to this many similar lines are told one by one."""
_NAMED = 8
"""Up to this many prims are named."""


def without_paths(text: str) -> str:
    """A text with the same mark in place of each prim path."""
    return _PATH.sub("/", text)


def grouped(things: Iterable, key) -> list[list]:
    """Groups of things with equal keys, in the order of each group's first thing."""
    groups: dict[Hashable, list] = {}
    for thing in things:
        groups.setdefault(key(thing), []).append(thing)
    return list(groups.values())


def told_once(texts: Iterable[str]) -> list[str]:
    """Texts, with those that differ only in prim paths merged into one that also names the other prims, or of many only the first
    and the last.
    """
    result = []
    for same in grouped(dict.fromkeys(texts), without_paths):
        if len(same) <= _SEPARATE:
            result += same
            continue
        # At the first position where they differ: before it there may be a file that all of them name.
        columns = zip(*(_PATH.findall(text) for text in same), strict=True)
        _, *others = next(column for column in columns if len(set(column)) > 1)
        if len(others) > _NAMED:
            others[_NAMED - 2 : -1] = ["..."]
        result.append(f"{same[0]} (likewise {len(same) - 1} more: {', '.join(others)})")
    return result


def few(lines: list[str], others: str = "prims are left out like that") -> list[str]:
    """The first of many similar lines about prims, and how many more there are: a set may have hundreds."""
    return lines if len(lines) <= _FEW + 1 else [*lines[:_FEW], f"{len(lines) - _FEW} more {others}"]
