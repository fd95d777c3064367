# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder from which an object's paths that begin with // are named, kept with the object while its file is open: what is copied
goes through a file of Blender's own elsewhere, with these paths as they were. Saved files do not hold it, since they may be moved.
"""

import os

import bpy

from .paths import library_of

KINDS = "CURVES", "ARMATURE"
"""Types of the objects that name models. Reading the settings of others would give them some."""


def remember(things, settings) -> None:
    """Note this file's folder with objects whose settings, given by their paths from the object, are named from it."""
    here = os.path.dirname(bpy.data.filepath)
    for thing in _own(things):
        for setting in settings:
            from_here = thing.path_resolve(setting).startswith("//") and library_of(thing, setting) is None
            _set(thing, setting, here if from_here else "")


def forget(settings) -> None:
    """The file is about to be saved."""
    for thing in _own(bpy.data.objects):
        for setting in settings:
            _set(thing, setting, "")


def folders(thing, settings) -> dict[str, str]:
    """The folder from which each setting is named; empty if that is unknown, or is not there any more."""
    found = {setting: _group(thing, setting).named_from for setting in settings}
    return {setting: folder if os.path.isdir(folder) else "" for setting, folder in found.items()}


def _own(things) -> list:
    return [thing for thing in things if thing.library is None and thing.type in KINDS]


def _set(thing, setting: str, folder: str) -> None:
    group = _group(thing, setting)
    if group.named_from != folder:
        group.named_from = folder


def _group(thing, setting: str):
    return getattr(thing, setting.partition(".")[0])
