# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that was imported with its motion: its curves have the shape of one moved frame, its USD file also has the rest shape."""

import numpy as np

from neuralocks_core.errors import NeuralocksError

from ..files.paths import full
from . import curves
from .muting import caches_of_others

TAKEN = "neuralocks_rest_taken"
"""A property of Curves that have the rest shape of their file, so that it is saved, appended and undone with the hair."""


def shaped_by(hair):
    """The modifier whose cache gave hair its shape at import; None if there is none, or if it has its rest shape since."""
    found = None if TAKEN in hair.data else caches_of_others(hair)
    return found[0] if found else None


def has_file(hair) -> bool:
    """Whether that cache is a USD file; otherwise it is Alembic, which knows no rest shape."""
    modifier = shaped_by(hair)
    cache = modifier.cache_file if modifier is not None else None
    return cache is not None and cache.filepath.lower().endswith((".usd", ".usda", ".usdc", ".usdz"))


def doubt(hair) -> str:
    """The note on hair whose shape may not be its rest shape; empty if there is no reason to doubt it."""
    modifier = shaped_by(hair)
    if modifier is None:
        return ""
    remedy = "press Rest Shape from File, or import it at rest" if has_file(hair) else "import it at rest"
    return f"'{modifier.name}' may have left it in the shape of a moved frame, not at rest; if so, {remedy}"


def take_rest(hair) -> str:
    """Give hair the rest shape that its file has, if its shape is still the one that it was imported in; returns the file's path.
    The caller shows it.

    Raises:
        NeuralocksError: it has another shape, or the file has no rest shape of it.
    """
    from usd.shot.strands.imported import imported_and_rest

    if not has_file(hair):
        raise NeuralocksError(f"{hair.name_full}: no modifier of it names a USD file that it was imported from")
    modifier = shaped_by(hair)
    path = full(modifier.cache_file.filepath, modifier.cache_file.library)
    imported, rest = imported_and_rest(path, modifier.object_path)
    if not np.array_equal(imported, curves.points(hair.data)) or imported.shape != rest.shape:
        raise NeuralocksError(
            f"{hair.name_full}: it no longer has the shape that {path} gave it: one of them was edited since; nothing was changed, so "
            "that no edit is lost; import the groom at rest"
        )
    curves.replace_rest(hair.data, rest)
    hair.data[TAKEN] = True
    return path
