# SPDX-License-Identifier: GPL-3.0-or-later
"""What is live in one scene and drawn by another: as part of the set behind it, or in an instance of a collection. There it
is at the frame of the scene that draws it, and moves as in its own.
"""

import bpy


def guests(scene) -> list[tuple]:
    """Live hair objects and armatures of other scenes that this one draws, each with a scene that it is in."""
    if len(bpy.data.scenes) < 2:
        return []
    behind = _behind(scene)
    instanced = {own for each in (scene, *behind) for own in _instanced(each)}
    if not behind and not instanced:
        return []
    found = {}
    for home in bpy.data.scenes:
        for thing in home.objects if home != scene else ():
            if _live(thing) and thing.name not in scene.objects:
                if home in behind or not instanced.isdisjoint(thing.users_collection):
                    found.setdefault(thing, home)
    return list(found.items())


def homes(scene) -> list:
    """The scenes that `guests` are of."""
    return list(dict.fromkeys(home for _, home in guests(scene)))


def _live(thing) -> bool:
    if thing.type == "ARMATURE":
        return thing.neuralocks_character.rig_live
    return thing.type == "CURVES" and thing.neuralocks_hair.live


def _behind(scene) -> list:
    """The set of a scene, the set of that, and so on."""
    found = []
    while (scene := scene.background_set) is not None and scene not in found:
        found.append(scene)
    return found


def _instanced(scene) -> set:
    """Collections whose instances a scene draws, with those in them."""
    found = set()
    todo = list(_shown_by(scene.objects))
    while todo:
        collection = todo.pop()
        if collection not in found:
            found.add(collection)
            todo += [*collection.children, *_shown_by(collection.objects)]
    return found


def _shown_by(things):
    """Collections that some objects are instances of."""
    return (
        thing.instance_collection
        for thing in things
        if thing.instance_type == "COLLECTION" and thing.instance_collection
    )
