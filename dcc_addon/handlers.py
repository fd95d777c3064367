# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender calls: each handler a few lines, all work in `live`."""

import bpy
from bpy.app.handlers import persistent

from . import live, live_rig
from .session import session


@persistent
def on_frame(scene, graph=None):
    """A new frame is evaluated, in the viewport or for a render."""
    live.update(scene, graph or bpy.context.evaluated_depsgraph_get(), moved=True)


@persistent
def on_update(scene, graph):
    """Something was edited: follow a pose made by hand, and notice edited animation."""
    if session.paused or not (live.live_hairs(scene) or live_rig.live_armatures(scene)):
        return
    armatures = {o.neuralocks_hair.armature for o in live.live_hairs(scene)} | set(live_rig.live_armatures(scene))
    names = {a.name for a in armatures if a is not None}
    for update in graph.updates:
        if isinstance(update.id, bpy.types.Action):
            _mark_stale()
        elif isinstance(update.id, bpy.types.Object) and (update.id.name in names or _mode_changed(update.id)):
            live.update(scene, graph)
            break


@persistent
def on_load(*_):
    """Another file: nothing that is known belongs to it."""
    from . import background

    background.cancel()
    session.clear()
    for scene in bpy.data.scenes:
        if live.needs_sampling(scene):
            background.request()


@persistent
def on_undo(scene, *_):
    """Undo may have brought back another pose or groom."""
    session.hairs.clear()
    live.refresh(scene)


@persistent
def before_save(*_):
    """The saved file holds the hair at rest, so that it opens right without the add-on."""
    for scene in bpy.data.scenes:
        for hair in live.live_hairs(scene):
            live.show_rest(hair)
        for armature in live_rig.live_armatures(scene):
            live_rig.show_rest(armature)


@persistent
def after_save(*_):
    """Go on as before the save."""
    live.refresh(bpy.context.scene)


@persistent
def before_render(scene, *_):
    """A render must be right: sample now what is out of date."""
    from .scene.sampling import ensure

    for armature in live.needs_sampling(scene):
        try:
            ensure(bpy.context, armature)
        except live.NeuralocksError as error:
            session.messages[armature.name] = str(error)
    live.refresh(scene)


def _mark_stale() -> None:
    from .background import request

    for sampled in session.rigs.values():
        sampled.stale = True
    session.failed.clear()
    request()


def _mode_changed(candidate) -> bool:
    return candidate.type == "CURVES" and candidate.mode in live.EDITING


HANDLERS = {
    "frame_change_post": on_frame,
    "depsgraph_update_post": on_update,
    "load_post": on_load,
    "undo_post": on_undo,
    "redo_post": on_undo,
    "save_pre": before_save,
    "save_post": after_save,
    "save_post_fail": after_save,
    "render_init": before_render,
}


def attach() -> None:
    """Put the handlers on their lists; `save_post_fail` is younger than the oldest Blender."""
    for name, handler in HANDLERS.items():
        calls = getattr(bpy.app.handlers, name, None)
        if calls is not None and handler not in calls:
            calls.append(handler)


def detach() -> None:
    """Take them off again."""
    for name, handler in HANDLERS.items():
        calls = getattr(bpy.app.handlers, name, None)
        if calls is not None and handler in calls:
            calls.remove(handler)
