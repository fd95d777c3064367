# SPDX-License-Identifier: GPL-3.0-or-later
"""Model files as the panel names them."""

import os

import bpy

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from neuralocks_core.models.runtime import StrandModel

from ..scene.files.paths import MODELS, absolute, library_of
from ..session import session


def load_model(found: str) -> StrandModel:
    """The model at an absolute path, read once while it does not change; does not call Blender."""
    now, kept = stamp(found), session.models.get(found)
    if kept is None or kept[0] != now:
        kept = session.models[found] = now, StrandModel.load(found)
    return kept[1]


def stamp(found: str) -> tuple | None:
    """A stamp that changes when the file at an absolute path changes; None if there is none."""
    try:
        status = os.stat(found)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def model_path(thing, kind: str = "strands") -> str:
    """Absolute path of the model of a hair object, or of an armature with hair bones: `named_model`, else the shipped one."""
    return named_model(thing, kind) or str(model_file.shipped(kind))


def named_model(thing, kind: str = "strands") -> str | None:
    """Absolute path of the model that the panel names for such an object; None if it names none.

    Raises:
        NeuralocksError: it is named relative to a file, and is not there.
    """
    path = thing.path_resolve(MODELS[kind])
    if not path.strip():
        return None
    library = library_of(thing, MODELS[kind])
    found = absolute(path, library)
    if path.startswith("//") and not os.path.exists(found):
        raise NeuralocksError(
            f"{thing.name_full}: no such model file: {os.path.normpath(found)}; {path} means beside "
            f"{library.name if library else 'this file'}{_elsewhere(path)}; choose its model again"
        )
    return found


def _elsewhere(path: str) -> str:
    """Where a file named relative to this one is instead: beside a library from which something was made local."""
    for library in bpy.data.libraries:
        found = absolute(path, library)
        if os.path.exists(found):
            return f", and beside {library.name} there is {os.path.normpath(found)}"
    return ", and what was appended or made local was named as beside its own file"
