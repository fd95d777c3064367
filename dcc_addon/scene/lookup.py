# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects by full name, which tells a linked object from a local one of the same name."""

import bpy

from neuralocks_core.errors import NeuralocksError


def find(name_full: str):
    """The object of this full name, or None."""
    thing = bpy.data.objects.get(name_full)
    if thing is not None and thing.name_full == name_full:
        return thing
    return next((o for o in bpy.data.objects if o.name_full == name_full), None)


def named(name_full: str):
    """The object of this full name, which longer work began with.

    Raises:
        NeuralocksError: there is none any more.
    """
    thing = find(name_full)
    if thing is None:
        raise NeuralocksError(f"{name_full}: it was deleted or renamed meanwhile; start again")
    return thing
