# SPDX-License-Identifier: GPL-3.0-or-later
"""Files as properties name them, and objects of other files: which library they are from, and whether it was found."""

import os
from pathlib import Path

import bpy

from neuralocks_core.errors import NeuralocksError

_RELATIVE = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5) else set()
FILE = {"subtype": "FILE_PATH", "options": _RELATIVE}
"""Arguments for such a property; since 4.5, Blender warns about // unless the property says that it supports it."""
MODELS = {"strands": "neuralocks_hair.model", "rig": "neuralocks_character.rig_model"}
"""The setting in which an object names its model, as a path from the object, by the model's kind."""


def absolute(path: str, library=None) -> str:
    """The absolute path of one that may begin with //, the folder of the saved file, or of the library that it is from.

    Raises:
        NeuralocksError: the file is not saved, so that // means nothing.
    """
    if path.startswith("//") and library is None and not bpy.data.filepath:
        raise NeuralocksError(
            f"{path}: this file is not saved yet, so there is no folder beside it; save the file or choose a full path"
        )
    return full(path, library)


def full(path: str, library=None, folder: str | None = None) -> str:
    """The same, unchecked; from a `folder` rather than that of the library, if one is given. A path from Windows may separate folders by
    backslashes after the //, which are letters elsewhere.
    """
    if path.startswith("//"):
        path = path.replace("\\", "/")
    return bpy.path.abspath(path, start=folder, library=None if folder else library)


def usual_output() -> str:
    """Where a bake is written if nothing else is chosen: beside this file and named after it, so that no other scene's is replaced."""
    return f"//{Path(bpy.data.filepath).stem or 'untitled'}_hair.usdc"


def beside(path) -> str:
    """How a file is reached from the folder of another at `path`, with slashes; empty if this file is not saved, or on another drive.
    Both stay together when their folder is moved.
    """
    try:
        return Path(os.path.relpath(bpy.data.filepath, Path(path).parent)).as_posix() if bpy.data.filepath else ""
    except ValueError:
        return ""


def library_of(thing, setting: str):
    """The library in whose file a setting of an object was made; None for this file. A library override has the value of what it
    overrides until it gets another.
    """
    while (override := thing.override_library) is not None and override.reference is not None:
        if override.reference.path_resolve(setting) != thing.path_resolve(setting):
            break
        thing = override.reference
    return thing.library


def models_from_here(thing) -> dict[str, str]:
    """Paths by which an object names models relative to this file, by setting."""
    named = ((setting, thing.path_resolve(setting)) for setting in MODELS.values())
    return {each: path for each, path in named if path.startswith("//") and library_of(thing, each) is None}


def check_found(thing) -> None:
    """Refuse an object from a library file that Blender did not find: what stands in its place is empty.

    Raises:
        NeuralocksError: it is one.
    """
    source = thing.override_library.reference if thing.override_library else thing
    if getattr(source, "is_missing", False):  # older Blenders do not tell
        raise NeuralocksError(
            f"{thing.name_full}: its file {source.library.filepath} was not found when this file was opened; put it back and open "
            "this file again, or relocate the library in the Outliner (Blender File)"
        )


def check_own(thing) -> None:
    """Refuse an object that belongs to another file: changes to it are not saved.

    Raises:
        NeuralocksError: it does.
    """
    if thing.library is not None:
        raise NeuralocksError(
            f"{thing.name}: it is linked from {thing.library.name}, and changes here are not saved; make a library "
            "override of it (Object > Library Override > Make) or make it local"
        )
