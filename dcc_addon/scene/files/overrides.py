# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of library overrides. Blender stores how an overridden object differs from the linked one, setting by setting; but
since 5.0, if only one of them has settings at all, as when a library was made without this add-on, it stores that they differ
as a whole, and loses them when the file is opened or the override is resynchronised.
"""

import bpy

SETTINGS = "neuralocks_hair", "neuralocks_character"


def make_comparable(things) -> None:
    """Let those of these objects that are overrides, and the linked objects that they override, both have settings."""
    for thing in things:
        override = thing.override_library
        if override is None or not isinstance(override.reference, bpy.types.Object):
            continue
        for name in SETTINGS:
            getattr(thing, name), getattr(override.reference, name)  # reading makes them
        whole = [stored for stored in override.properties if stored.rna_path in SETTINGS]
        for stored in whole:
            override.properties.remove(stored)
        if whole:
            override.operations_update()
