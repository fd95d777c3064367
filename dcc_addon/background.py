# SPDX-License-Identifier: GPL-3.0-or-later
"""Sampling in the background, a few frames at a time while Blender is idle, so that live hair follows an edited animation
by itself.
"""

import time

import bpy

from .live.view import carriers, needs_sampling, refresh
from .scene.character.layers import working_in
from .scene.drawing.redraw import redraw
from .scene.drawing.windows import drawing, layer_shown, scenes_shown
from .scene.motion.sampling import in_slices
from .scene.motion.up_to_date import notice
from .session import session

SLICE = 0.05
"""Longest time that Blender is kept busy at once [s]."""
PAUSE = 0.3
"""Time without a further edit before sampling begins [s]."""

_work: list = []
_wanted = {"at": 0.0, "closely": False, "edits": -1}
"""When to look, on the clock, whether to look at how rigs are made up, too, and after how many edits of animation."""


def request() -> None:
    """Sample what is out of date, from the start, once nothing has been edited for a while. Without a window nobody waits for it,
    and operators sample when they need it.
    """
    _work.clear()
    if bpy.app.background:
        return
    _wanted["at"], _wanted["edits"] = time.perf_counter() + PAUSE, session.edits
    if not bpy.app.timers.is_registered(look):
        bpy.app.timers.register(look, first_interval=PAUSE)


def want() -> None:
    """Sample what is out of date, because it is shown. Every frame shows it until it is sampled: what is at work, or about to begin,
    goes on, or an artist who scrubs would wait for ever. It begins again if animation was edited since.
    """
    if _wanted["edits"] != session.edits or not bpy.app.timers.is_registered(look):
        request()


def doubt(closely: bool = True) -> None:
    """A rig has changed, perhaps only its pose: check soon whether its motion is out of date; unless `closely`, only whether other
    things are drawn or sampled.
    """
    _wanted["closely"] = _wanted["closely"] or closely
    if not _work:
        request()


def cancel() -> None:
    """Stop; the motion stays out of date."""
    _work.clear()
    session.sampling.done = None
    if bpy.app.timers.is_registered(look):
        bpy.app.timers.unregister(look)


def look() -> float | None:
    """Blender's timer: sample for SLICE; seconds until the next look, None when nothing is out of date."""
    if _busy(bpy.context):
        return PAUSE
    if (wait := _wanted["at"] - time.perf_counter()) > 0:
        return wait
    scenes = scenes_shown()
    if _work and not any(_concerns(scene) for scene in scenes):  # other scenes are shown now, or it is no longer live
        _work.clear()
    if not _work:
        if _wanted["closely"]:
            _wanted["closely"] = False
            for scene in scenes:
                for armature in carriers(scene):
                    notice(armature, scene)
        todo = _todo(scenes)
        if todo is None:
            session.sampling.done = None
            redraw()
            return None
        scene, armature = todo
        _work.append((scene.name_full, armature.name_full, in_slices(bpy.context, armature, SLICE)))
    scene = next(scene for scene in scenes if scene.name_full == _work[0][0])
    with working_in(scene, layer_shown(scene)):
        _go_on()
    if not _work:
        session.sampling.done = None
        for shown in drawing(scene):
            refresh(shown)
        session.sampling.wanting = False  # the next look finds what else is out of date, without a start of its own
    redraw()
    return 0.01


def _todo(scenes: list) -> tuple | None:
    """The next (scene, armature) to sample; an armature in several scenes moves as in the first of them."""
    seen = set()
    for scene in scenes:
        for armature in needs_sampling(scene):
            if armature not in seen and armature.name_full not in session.sampling.failed:
                return scene, armature
        seen |= set(carriers(scene))
    return None


def _concerns(scene) -> bool:
    """Whether this is the scene at work, and something on the armature at work is live in it."""
    name, armature, _ = _work[0]
    return scene.name_full == name and any(each.name_full == armature for each in carriers(scene))


def _go_on() -> None:
    """Sample the current armature for SLICE; afterwards `_work` is empty if it is done or has failed."""
    _, name, slices = _work[0]
    try:
        for done, total in slices:
            session.sampling.done = done / total
            return
    except Exception as error:
        session.said.tell(name, error)
        session.sampling.failed.add(name)
    _work.clear()


def _busy(context) -> bool:
    playing = any(w.screen.is_animation_playing for w in context.window_manager.windows)
    return playing or bool(session.working) or bpy.app.is_job_running("RENDER")
