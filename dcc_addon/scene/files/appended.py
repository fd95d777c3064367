# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of objects that are appended from another file, or pasted: Blender updates its own paths that begin with //, but not those
of add-ons.
"""

import os

import bpy

from . import named_from
from .paths import full, models_from_here
from .save_as import relative, set_path


def remake(items) -> None:
    """Rewrite settings of appended objects that name a model relative to their source file, or to the one that they were copied in, so
    that they name the same file from here; `items` are what Blender reports about an import, since 4.3.
    """
    here = os.path.dirname(bpy.data.filepath)
    for item in items:
        thing, library = item.id, item.source_library
        if item.append_action not in ("MAKE_LOCAL", "COPY_LOCAL") or library is None:
            continue
        if not isinstance(thing, bpy.types.Object) or thing.library is not None:
            continue
        named = models_from_here(thing)
        folders = {
            setting: named_from.folder(thing, setting) for setting in named
        }  # all: writing a path notes new ones
        for setting, path in named.items():
            whole = os.path.normpath(full(path, library, folders[setting]))
            set_path(thing, setting, relative(whole, here) if here else whole)
        named_from.remember([thing])
