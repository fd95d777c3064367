# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of what hair was baked of, stored with the bake as text, so that the panel can say what was changed since."""

import zlib

NOTE = "Changed since the bake, which shows it as it was: {what}; press {remedy} again"


def number_of(found) -> int:
    """A number that changes when `found` does, which is told by its text."""
    return zlib.crc32(repr(found).encode())


def as_text(numbers: dict[str, int | None]) -> str:
    """What is stored: the numbers in their order, a dash for what is unknown."""
    return " ".join("-" if number is None else f"{number:08x}" for number in numbers.values())


def changed(told, now: dict[str, int | None]) -> list[str]:
    """Which parts have other numbers `now` than in `told`; none if that does not hold a number of each, and so is something else. What
    is unknown counts as the same.
    """
    then, today = str(told).split(" "), as_text(now).split(" ")
    if len(then) != len(now):
        return []
    return [part for part, old, new in zip(now, then, today, strict=True) if old != new and "-" not in (old, new)]


def note(parts: list[str], remedy: str) -> str:
    """What the panel says of changed parts."""
    return NOTE.format(what=", ".join(parts), remedy=remedy)
