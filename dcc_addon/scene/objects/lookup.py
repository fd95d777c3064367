# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects by full name, which tells a linked object from a local one of the same name."""

import bpy

from neuralocks_core.errors import NeuralocksError

from ...session import session


def find(name_full: str):
    """The object of this full name, or None."""
    thing = bpy.data.objects.get(name_full)
    if thing is not None and thing.name_full == name_full:
        return thing
    return next((o for o in bpy.data.objects if o.name_full == name_full), None)


def in_scene(thing, scene) -> bool:
    """Whether a scene has this very object: one of another file may have its name."""
    found = scene.objects.get(thing.name)
    return found == thing or (found is not None and thing in scene.objects.values())


def identity(thing):
    """Distinguishes a data block from all others of this Blender session, also from a later one of its name. The oldest Blenders do
    not number data blocks, and there an undo may change it.
    """
    number = getattr(thing, "session_uid", None)
    return (session.files, thing.as_pointer()) if number is None else number


def identified(number):
    """The object with this identity, whatever its name is now, or None."""
    return next((o for o in bpy.data.objects if identity(o) == number), None)


def named(name_full: str):
    """The object of this full name, for longer work that began with it.

    Raises:
        NeuralocksError: it no longer exists.
    """
    thing = find(name_full)
    if thing is None:
        raise NeuralocksError(f"{name_full}: it was deleted or renamed meanwhile; start again")
    return thing
