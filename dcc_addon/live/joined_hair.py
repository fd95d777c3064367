# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair that an artist joins to other hair, in Blender 5.2 and later. Blender converts the points to the other hair's
space; the rest shape, an ordinary attribute, stays in the space of the hair that was joined.
"""

import zlib

import bpy
import numpy as np

from neuralocks_core.rotation import inverse, transformed

from ..live_state import Stood
from ..scene.character.armature import matrix
from ..scene.hair import curves
from ..scene.objects.lookup import identity
from ..session import session
from .point_edits import ROUNDING


def remember(hair, rest: int) -> None:
    """Note where hair stands whose points have just been written; `rest` is the checksum of `curves.points`."""
    written = session.shown.written[hair.name_full]
    # Not read from Blender, which copies the whole of an attribute shared with the evaluated hair before it can be read.
    root = written.rest[0].copy()  # not a view, which would keep all of the rest shape of hair that is deleted
    session.shown.stood[identity(hair)] = Stood(written.points, written.places[1], root, rest)


def forget(hair) -> None:
    """Live is over for this hair."""
    session.shown.stood.pop(identity(hair), None)


def settle(hair) -> None:
    """Convert the rest shapes of live hair that was joined to this hair into its space, if that is still to be done: also after an
    undo, which goes back to Blender's own result.
    """
    data, written = hair.data, session.shown.written.get(hair.name_full)
    if written is not None and len(written.points) == len(data.points):
        return
    if data.library is not None or not session.shown.stood or not curves.has_rest(data):
        return
    there = {identity(thing) for scene in bpy.data.scenes for thing in scene.objects}
    here = matrix(hair.matrix_world)
    for stood in (stood for number, stood in session.shown.stood.items() if number not in there):
        for part in _parts(data, stood):
            change = inverse(here) @ stood.world
            moved = transformed(stood.points, change)
            # Copies have the same rest shape: the points tell which of them is where.
            if np.abs(moved - curves.shown(data)[part]).max() <= ROUNDING * np.abs(moved).max():
                curves.move_rest(data, change, part)
                break


def _parts(data, stood: Stood) -> list[slice]:
    """Where points of a hair object have exactly the rest shape of hair that was joined to it."""
    rest, count = curves.points(data), len(stood.points)
    if count >= len(rest):  # a moved copy of it
        return []
    starts = np.flatnonzero((rest == stood.root).all(axis=1))
    parts = [slice(start, start + count) for start in starts.tolist() if start + count <= len(rest)]
    return [part for part in parts if zlib.crc32(rest[part]) == stood.rest]
