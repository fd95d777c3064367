# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of objects that are appended from another file, or pasted: Blender updates its own paths that begin with //, but not those
of add-ons.
"""

import os

import bpy

from . import named_from
from .paths import full, library_of
from .save_as import relative, set_path


def remake(items, settings) -> None:
    """Rewrite settings of appended objects that name a file relative to their source file, or to the one that they were copied in, so
    that they name the same file from here.

    Args:
        items: what Blender reports about an import, since 4.3.
        settings: paths of the settings, from the object.
    """
    here = os.path.dirname(bpy.data.filepath)
    for item in items:
        thing, library = item.id, item.source_library
        if item.append_action not in ("MAKE_LOCAL", "COPY_LOCAL") or library is None:
            continue
        if not isinstance(thing, bpy.types.Object) or thing.library is not None:
            continue
        for setting, folder in named_from.folders(thing, settings).items():
            path = thing.path_resolve(setting)
            if path.startswith("//") and library_of(thing, setting) is None:
                whole = os.path.normpath(full(path, library, folder or None))
                set_path(thing, setting, relative(whole, here) if here else whole)
        named_from.remember([thing], settings)
