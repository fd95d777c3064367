# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder from which an object's paths that begin with // are named, kept with the object while its file is open: what is copied
goes through a file of Blender's own elsewhere, with these paths as they were. Saved files do not hold it, since they may be moved.
"""

import os

import bpy

from .paths import MODELS, models_from_here

KINDS = "CURVES", "ARMATURE"
"""Types of the objects that name models. Reading the settings of others would give them some."""


def remember(things) -> None:
    """Note this file's folder with objects that name models from it."""
    here = os.path.dirname(bpy.data.filepath)
    for thing in _own(things):
        from_here = models_from_here(thing)
        for setting in MODELS.values():
            _set(thing, setting, here if setting in from_here else "")


def forget() -> None:
    """The file is about to be saved."""
    for thing in _own(bpy.data.objects):
        for setting in MODELS.values():
            _set(thing, setting, "")


def folder(thing, setting: str) -> str | None:
    """The folder from which a setting is named; None if that is unknown, or is not there any more."""
    found = _group(thing, setting).named_from
    return found if os.path.isdir(found) else None


def _own(things) -> list:
    return [thing for thing in things if thing.library is None and thing.type in KINDS]


def _set(thing, setting: str, folder: str) -> None:
    group = _group(thing, setting)
    if group.named_from != folder:
        group.named_from = folder


def _group(thing, setting: str):
    return getattr(thing, setting.partition(".")[0])
