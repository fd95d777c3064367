# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects are live, or draw live ones: found in one pass, since every frame asks and a scene may have ten thousand."""

from typing import NamedTuple

_KINDS = frozenset(("CURVES", "ARMATURE", "EMPTY"))


class Lively(NamedTuple):
    """Hair objects that are live, armatures whose hair bones are, and collections that some of the objects instance."""

    hairs: list
    armatures: list
    instanced: list


def lively(things) -> Lively:
    """What is lively among some objects."""
    found = Lively([], [], [])
    for thing in [thing for thing in things if thing.type in _KINDS]:
        if thing.type == "CURVES":
            if thing.neuralocks_hair.live:
                found.hairs.append(thing)
        elif thing.type == "ARMATURE":
            if thing.neuralocks_character.rig_live:
                found.armatures.append(thing)
        elif thing.instance_type == "COLLECTION" and thing.instance_collection:
            found.instanced.append(thing.instance_collection)
    return found
