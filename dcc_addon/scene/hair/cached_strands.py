# SPDX-License-Identifier: GPL-3.0-or-later
"""Strands that were edited after a cache was attached to them: Blender up to 4.2 crashes where a cache has others than the object, and
later ones show those of the cache. If they have got one radius a strand, Blender since 5.0 crashes where the cache has widths.
"""

import bpy

from .curves import one_radius_a_strand

KEY = "neuralocks_cached"
"""The property of Curves that says how many strands and points their cache has, and, by a third number, that it has no widths."""
OFF = "neuralocks_cache_off"
"""The property that says that their cache was switched off because they have others."""


def remember(data) -> None:
    """Note what these Curves are made of, unless they belong to another file, where nobody edits them."""
    if data.library is None and data.override_library is None:
        data[KEY] = _sizes(data)
        data.pop(OFF, None)


def forget(data) -> None:
    """Their cache was removed."""
    if data.library is None and data.override_library is None:
        for key in (KEY, OFF):
            data.pop(key, None)


def changed(data) -> bool:
    """Whether strands were added or deleted since a cache was attached, or their radii became such, or no longer such, as it leaves as
    they are.
    """
    told = data.get(KEY)
    return told is not None and list(told) != _sizes(data)


def is_off(data) -> bool:
    """Whether their cache was switched off for that."""
    return OFF in data


def to_switch() -> list[tuple]:
    """All Curves whose cache should be switched off, or, after an undo, on again, with whether on; that counts as done."""
    own = (data for data in bpy.data.hair_curves if data.library is None)
    found = [(data, is_off(data)) for data in own if changed(data) != is_off(data)]
    for data, on in found:
        if on:
            data.pop(OFF)
        else:
            data[OFF] = True
    return found


def _sizes(data) -> list[int]:
    return [len(data.curves), len(data.points), *([1] if one_radius_a_strand(data) else [])]
