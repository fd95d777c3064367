# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths relative to the file, with //. When the file is saved in another folder, Blender updates its own paths, but not
those of add-ons.
"""

import os

import bpy

from .paths import full, models_from_here


class Remade:
    """Settings of this file that name a model relative to it, rewritten for another folder."""

    def __init__(self, target: str):
        self._source, folder = bpy.data.filepath, os.path.dirname(target)
        self._kept = []
        if not self._source or folder == os.path.dirname(self._source):
            return
        for thing in (o for o in bpy.data.objects if o.library is None):
            for setting, path in models_from_here(thing).items():
                self._kept.append((thing.name, setting, path))
                set_path(thing, setting, relative(full(path), folder))

    def put_back(self) -> None:
        """Undo that if the file's own path has not changed: after a copy was saved, or nothing was."""
        if bpy.data.filepath != self._source:
            return
        for name, setting, path in self._kept:
            set_path(bpy.data.objects[name, None], setting, path)


def named_here(path: str) -> str:
    """An absolute path as it is named in this file, so that both can be moved together; unchanged while the file is not saved."""
    return relative(path, os.path.dirname(bpy.data.filepath)) if bpy.data.filepath else path


def relative(path: str, folder: str) -> str:
    """An absolute path as it is named in a file in `folder`, so that every system finds it; unchanged on another drive."""
    if os.path.splitdrive(path)[0] != os.path.splitdrive(folder)[0]:
        return path
    return bpy.path.relpath(path, start=folder).replace(os.sep, "/")


def set_path(thing, setting: str, path: str) -> None:
    """Write a setting that is given by its path from the object."""
    group, _, name = setting.partition(".")
    setattr(getattr(thing, group), name, path)
