# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of anything in Blender, whatever they are: of a constraint, a strip, a modifier."""

from functools import cache

import bpy

NOT_SET = {
    "name",
    "active",
    "is_active",
    "select",
    "show_expanded",
    "show_in_editmode",
    "show_on_cage",
    "strip_time",
    "influence",
}
"""Settings that only affect how something is shown, and those of strips that Blender itself writes."""


def settings_of(thing) -> list[str]:
    """Names of the settings of a kind of thing."""
    return _written(type(thing))


def as_set(thing, names) -> list:
    """What these settings are; of other data blocks, their names."""
    found = []
    for name in names:
        value = getattr(thing, name)
        if isinstance(value, bpy.types.ID):
            value = value.name_full
        elif isinstance(value, bpy.types.bpy_prop_array):
            value = value[:]
        elif isinstance(value, set):
            value = sorted(value)
        if not isinstance(value, bpy.types.bpy_struct):
            found.append(value)
    return found


def objects_named(thing) -> list:
    """The objects that are among the settings, such as the armature of a modifier; without those that its node group names."""
    return [other for name in _naming(type(thing)) if (other := getattr(thing, name)) is not None]


@cache
def _written(kind: type) -> list[str]:
    properties = (p for p in kind.bl_rna.properties if not p.is_readonly and p.type != "COLLECTION")
    return [p.identifier for p in properties if p.identifier not in NOT_SET]


@cache
def _naming(kind: type) -> list[str]:
    pointers = (p for p in kind.bl_rna.properties if p.type == "POINTER")
    return [p.identifier for p in pointers if p.fixed_type.identifier == "Object"]
