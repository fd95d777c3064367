# SPDX-License-Identifier: GPL-3.0-or-later
"""The live view of strands and hair bones. Everything is a function of the scene as it is now."""

from dataclasses import replace

import bpy

from ..scene.character.layers import elsewhere, graph_of, layer_of
from ..scene.drawing.other_scenes import guests
from ..scene.drawing.render_lock import lock
from ..scene.motion.up_to_date import current
from ..scene.objects.live_objects import lively
from ..scene.objects.lookup import find, in_scene
from ..session import session
from . import live_rig, live_strands


def strands_toggled(hair, scene, wait: bool) -> None:
    """The Live switch of strands was used; `wait` as for `update`."""
    session.forget(hair.name_full)
    if hair.neuralocks_hair.live:
        lock()
        refresh(scene, wait)
    else:
        live_strands.rest(hair)


def rig_toggled(armature, scene) -> None:
    """The Live switch of the hair bones was used."""
    session.said.messages.pop(armature.name_full, None)
    if armature.neuralocks_character.rig_live:
        lock()
        refresh(scene)
    else:
        live_rig.rest(armature)


def loop_changed(armature, scene) -> None:
    """The switch that makes the frame range of this character loop was used."""
    sampled = session.rigs.get(armature.name_full)
    if sampled is not None:
        sampled.clip = replace(sampled.clip, loop=armature.neuralocks_character.loop)
    refresh(scene)


def refresh(scene, wait: bool = False, moved: bool = False) -> None:
    """Show the hair of the current frame, other than at a frame change; `wait` and `moved` as for `update`."""
    if session.paused or scene is None:
        return
    for layer in _layers(scene):
        update(scene, graph_of(scene, layer), moved, wait)


def _layers(scene) -> list:
    """The view layer in view, and others in which something live moves; none if the scene has not been shown yet."""
    in_view = bpy.context.scene == scene
    found = [bpy.context.view_layer] if in_view else [layer for layer in scene.view_layers if layer.depsgraph][:1]
    for armature in carriers(scene) if found else ():
        layer = layer_of(armature, scene)
        if layer is not None and layer not in found:
            found.append(layer)
    return found


def update(scene, graph, moved: bool = False, wait: bool = False) -> None:
    """Move live hair to the pose that `graph` has evaluated; what moves only in other view layers stays as it is.

    Args:
        scene: its frame gives the time.
        graph: viewport or render depsgraph.
        moved: whether the frame has just changed: then a pose unlike the sampled one means that the animation has changed.
        wait: prepare hair that is not prepared yet before this returns, not in the background.
    """
    if session.paused:
        return
    own = lively(scene.objects)
    for hair in own.hairs:
        if not elsewhere(hair.neuralocks_hair.armature, scene, graph):
            live_strands.update(hair, scene, graph, moved, wait)
    for armature in own.armatures:
        if not elsewhere(armature, scene, graph):
            live_rig.update(armature, scene, graph, moved)
    for thing, home in guests(scene, own):
        _update_guest(thing, home, scene, graph, wait)


def _update_guest(thing, home, scene, graph, wait: bool) -> None:
    """The same for a thing of the scene `home` that this scene's graph has. Only there is it checked whether it is out of date."""
    armature = thing if thing.type == "ARMATURE" else thing.neuralocks_hair.armature
    if armature is None or not all(each.evaluated_get(graph).is_evaluated for each in (armature, thing)):
        return
    if thing == armature:
        live_rig.update(armature, scene, graph)
    else:
        live_strands.update(thing, scene, graph, False, wait, home)


def show_rest(scene) -> None:
    """Show all live hair of a scene as it was groomed, until somebody refreshes it."""
    own = lively(scene.objects)
    for hair in own.hairs:
        live_strands.show_rest(hair)
    for armature in own.armatures:
        live_rig.show_rest(armature)


def forget_gone() -> None:
    """Drop messages about objects that were renamed or deleted: another object may get such a name. So is hair that was prepared for
    one, or written to it: a large groom holds hundreds of megabytes.
    """
    kept = session.said.messages, session.said.misrendered, session.said.cards, session.hairs, session.shown.written
    for gone in [name for name in set().union(*kept) if find(name) is None]:
        for each in kept:
            each.pop(gone, None)


def forget_ended() -> None:
    """Drop messages about what an undo has made no longer live. Without an undo they stay: they may say why Live went off by itself."""
    own = lively(bpy.data.objects)
    named = (*own.hairs, *own.armatures, *(hair.neuralocks_hair.armature for hair in own.hairs))
    live = {thing.name_full for thing in named if thing is not None}
    for name in session.said.messages.keys() - live:
        del session.said.messages[name]


def bereft(scene) -> bool:
    """Whether hair of the scene is still shown as an armature moved it that has been deleted."""
    if not session.shown.written:
        return False
    moved = (hair for hair in lively(scene.objects).hairs if hair.name_full in session.shown.written)
    found = (hair.neuralocks_hair.armature for hair in moved)
    return any(armature is None or not in_scene(armature, scene) for armature in found)


def carriers(scene) -> list:
    """Armatures of the scene with something live on them, by name."""
    own = lively(scene.objects)
    wanted = {*(hair.neuralocks_hair.armature for hair in own.hairs), *own.armatures}
    return sorted((a for a in wanted if a is not None and in_scene(a, scene)), key=lambda a: a.name_full)


def needs_sampling(scene) -> list:
    """Those of `carriers` whose motion is unknown or out of date."""
    return [armature for armature in carriers(scene) if current(armature, scene) is None]
