# SPDX-License-Identifier: GPL-3.0-or-later
"""Characters that a scene only shows, as an instance of a collection: nothing in it can be posed or moved there."""

from neuralocks_core.errors import NeuralocksError


def check_real(things) -> None:
    """Refuse an object that shows a character as an instance.

    Raises:
        NeuralocksError: one of these objects does.
    """
    for thing in things:
        if not _shows_armature(thing, set()):
            continue
        library = thing.instance_collection.library
        real = "make it real (Object > Apply > Make Instances Real, with Parent and Keep Hierarchy)"
        override = "make a library override of it (Object > Library Override > Make), or "
        raise NeuralocksError(
            f"{thing.name}: it is an instance of the collection '{thing.instance_collection.name}'"
            f"{f' of {library.name}' if library else ''}, in which no character can be posed and no hair moved; select it "
            f"and {override if library else ''}{real}"
        )


def _shows_armature(thing, seen: set) -> bool:
    """Whether an object is an instance of a collection with an armature in it, or in another instance within."""
    collection = thing.instance_collection if thing.instance_type == "COLLECTION" else None
    if collection is None or collection in seen:
        return False
    seen.add(collection)
    return any(within.type == "ARMATURE" or _shows_armature(within, seen) for within in collection.all_objects)
