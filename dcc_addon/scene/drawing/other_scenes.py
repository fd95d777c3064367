# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that is live in one scene and drawn by another: as part of its background set, or in a collection instance. There it
is at the frame of the scene that draws it, and moves as in its own scene.
"""

import bpy

from ..objects.live_objects import Lively, lively


def guests(scene, own: Lively | None = None) -> list[tuple]:
    """Live hair objects and armatures of other scenes that this scene draws, each with a scene that it is in.

    Args:
        own: what is lively in the scene itself, if the caller knows it.
    """
    if len(bpy.data.scenes) < 2:
        return []
    own = own or lively(scene.objects)
    found, todo, seen = {}, list(own.instanced), set()
    for home in _behind(scene):
        there = lively(home.objects)
        found = {**dict.fromkeys([*there.hairs, *there.armatures], home), **found}
        todo += there.instanced
    while todo:
        collection = todo.pop()
        if collection not in seen:
            seen.add(collection)
            there = lively(collection.objects)
            found = {**dict.fromkeys([*there.hairs, *there.armatures]), **found}
            todo += [*collection.children, *there.instanced]
    here = {*own.hairs, *own.armatures}
    placed = ((thing, home or _home(thing, scene)) for thing, home in found.items() if thing not in here)
    return [(thing, home) for thing, home in placed if home is not None]


def homes(scene) -> list:
    """The scenes that `guests` are of."""
    return list(dict.fromkeys(home for _, home in guests(scene)))


def _behind(scene) -> list:
    """The set of a scene, the set of that, and so on."""
    found = []
    while (scene := scene.background_set) is not None and scene not in found:
        found.append(scene)
    return found


def _home(thing, guest_of):
    """Another scene that an object is in, None if there is none. It is found through collections, in a tenth of the time that
    looking through objects takes.
    """
    for scene in bpy.data.scenes:
        if scene != guest_of:
            if any(each.user_of_id(thing) for each in (scene.collection, *scene.collection.children_recursive)):
                return scene
    return None
