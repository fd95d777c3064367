# SPDX-License-Identifier: GPL-3.0-or-later
"""The handlers that Blender calls. Each only says what is done, in which order; the work is in `live`, `depsgraph_updates` and
`scene/`.
"""

import bpy
from bpy.app.handlers import persistent

from neuralocks_core.errors import NeuralocksError

from . import background
from .depsgraph_updates import doubt_motions, edited, forget_data, hair_placed, mark_stale, retry_failed
from .live import model_updates, view
from .live.live_strands import show_all_rest, show_rest_left
from .scene.baked.attach import switch_changed
from .scene.character.layers import working_in
from .scene.drawing.handler_order import go_last, others_called
from .scene.drawing.render_lock import lock
from .scene.drawing.rendered_scenes import drawn_with
from .scene.drawing.windows import in_view_last, layer_shown
from .scene.files import named_from
from .scene.files.appended import remake
from .scene.files.overrides import make_comparable
from .scene.files.save_as import Remade
from .scene.hair import blur
from .scene.motion.after_undo import note_actions
from .scene.motion.up_to_date import ensure
from .scene.objects.live_objects import lively
from .scene.objects.lookup import find
from .session import session


@persistent
def before_frame(*_):
    """A new frame is about to be evaluated."""
    go_last(on_frame)


@persistent
def on_frame(scene, graph=None):
    """A new frame is evaluated, in the viewport or for a render."""
    if session.paused:
        return
    graph = graph or bpy.context.evaluated_depsgraph_get()
    # What other handlers have posed since is evaluated first. Not for a render: its engine would not learn what has changed.
    if others_called() and graph.mode == "VIEWPORT" and view.carriers(scene):
        _unseen(graph.update)
    view.update(scene, graph, moved=True)
    _catch_up()


@persistent
def before_update(*_):
    """What was edited is about to be evaluated."""
    switch_changed()


@persistent
def on_update(scene, graph):
    """Something was edited: follow a pose made by hand, and notice edited animation."""
    switched, session.switched = session.switched, set()
    renewed, session.renewed = session.renewed, False
    if session.paused:
        return
    view.forget_gone()
    changed = [update.id for update in graph.updates]
    objects = {thing.name_full: thing.original for thing in changed if isinstance(thing, bpy.types.Object)}
    forget_data(graph, renewed)
    make_comparable(objects.values())  # a library may have been reloaded
    show_rest_left(objects.values())
    if view.bereft(scene):
        view.update(scene, graph)
    carriers = view.carriers(scene)
    mark_stale(graph, changed, carriers, switched, renewed)
    if not carriers:
        return
    retry_failed(changed)
    names, placed = {armature.name_full for armature in carriers}, hair_placed(graph)
    doubt_motions(changed, objects.keys(), names, placed)
    if names & objects.keys() or placed or any(map(edited, objects.values())):
        view.update(scene, graph)
    _catch_up()


@persistent
def on_load(*_):
    """Another file was opened: nothing that is known belongs to it."""
    background.cancel()
    session.clear()
    session.renewed = True
    if bpy.data.filepath:
        session.opened = {scene.name_full: (scene.frame_start, scene.frame_end) for scene in bpy.data.scenes}
    model_updates.compare()
    make_comparable(bpy.data.objects)
    named_from.remember(bpy.data.objects)
    own = lively(bpy.data.objects)
    if own.hairs or own.armatures:
        lock()
    for scene in bpy.data.scenes:
        if view.needs_sampling(scene):
            background.request()


@persistent
def before_undo(*_):
    """All will be reported as edited: note what is."""
    note_actions()


@persistent
def on_undo(scene, *_):
    """Undo may have brought back another pose, groom or choice."""
    session.doubt()
    session.renewed = True
    named_from.remember(bpy.data.objects)
    view.forget_gone()
    view.forget_ended()
    background.request()  # a half-done sampling refers to a scene that no longer exists
    view.refresh(scene)
    show_rest_left(bpy.data.objects)  # hair as it was before the update that followed a join


@persistent
def before_save(target=None, *_):
    """Save the hair at rest, so that the file opens right without the add-on, and paths with which it finds its models; Blender
    says since 4.0 where the file will be.
    """
    session.saving.blurred = blur.end()
    model_updates.remember()
    make_comparable(bpy.data.objects)
    for scene in bpy.data.scenes:
        view.show_rest(scene)
    show_all_rest()
    session.saving.remade = _unseen(lambda: Remade(target or bpy.data.filepath))
    named_from.forget()


@persistent
def after_save(*_):
    """Continue as before the save, in all scenes."""
    if session.saving.remade is not None:
        _unseen(session.saving.remade.put_back)
    named_from.remember(bpy.data.objects)
    for scene in in_view_last(bpy.data.scenes):
        view.refresh(scene)
    blurred, session.saving.blurred = session.saving.blurred, []
    for hair in filter(None, map(find, blurred)):
        blur.again(hair)


@persistent
def after_import(context, *_):
    """Let appended objects find their models."""
    _unseen(lambda: remake(context.import_items))


@persistent
def before_render(scene, *_):
    """A render must be right: sample now what is out of date, even if only the drawn pose shows it, and print which hair will not
    move on the console, which is all that a render farm keeps.
    """
    session.said.misrendered.clear()
    for drawn in drawn_with(scene):
        with working_in(drawn, layer_shown(drawn)):
            _make_ready(drawn)
        hairs = lively(drawn.objects).hairs
        for thing in [*hairs, *view.carriers(drawn)]:
            if thing.name_full in session.said.messages:
                print(f"Neuralocks: {session.said.messages[thing.name_full]}")
        for hair in hairs:
            blur.begin(hair, drawn)


def _make_ready(scene) -> None:
    """Sample what is out of date in this scene, and show its hair."""
    view.refresh(scene, wait=True, moved=True)
    for armature in view.carriers(scene):
        try:
            ensure(bpy.context, armature)
        except NeuralocksError as error:
            session.said.messages[armature.name_full] = str(error)
    view.refresh(scene, wait=True)


@persistent
def after_render(*_):
    """The render has ended, or was cancelled."""
    blur.end()


def _unseen(change):
    """Make a change, for example of settings, that the live view does not follow at once."""
    session.paused += 1
    try:
        return change()
    finally:
        session.paused -= 1


def _catch_up() -> None:
    """Sample soon, if live hair found its motion missing or out of date."""
    if session.sampling.wanting:
        session.sampling.wanting = False
        background.want()


HANDLERS = {
    "frame_change_pre": before_frame,
    "frame_change_post": on_frame,
    "depsgraph_update_pre": before_update,
    "depsgraph_update_post": on_update,
    "load_post": on_load,
    "undo_pre": before_undo,
    "undo_post": on_undo,
    "redo_pre": before_undo,
    "redo_post": on_undo,
    "save_pre": before_save,
    "save_post": after_save,
    "save_post_fail": after_save,
    "blend_import_post": after_import,
    "render_init": before_render,
    "render_complete": after_render,
    "render_cancel": after_render,
}


def attach() -> None:
    """Put the handlers on their lists; some are younger than the oldest Blender."""
    for name, handler in HANDLERS.items():
        calls = getattr(bpy.app.handlers, name, None)
        if calls is not None and handler not in calls:
            calls.append(handler)


def detach() -> None:
    """Remove them again."""
    for name, handler in HANDLERS.items():
        calls = getattr(bpy.app.handlers, name, None)
        if calls is not None and handler in calls:
            calls.remove(handler)
