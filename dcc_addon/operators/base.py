# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared by all operators: errors as reports, and long work with progress and cancel."""

import math
import time
import traceback

import bpy

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.time_left import TimeLeft

from .. import background
from ..live.view import refresh
from ..scene.files.paths import FILE, check_found
from ..scene.motion.sampling import in_slices
from ..scene.motion.up_to_date import known
from ..scene.objects.lookup import in_scene
from ..services.panel.panel_errors import for_the_panel
from ..services.panel.remaining import in_words
from ..session import session

SLICE = 0.06
"""Time after which there is a chance to cancel [s]."""
SAMPLED = 0.1
"""The same while frames are stepped [s]: to the artist's frame and back takes two frames more each time."""
ONCE = {"options": {"SKIP_SAVE"}}
"""How a property is made that names what one run is about: Blender would give the next button the name of the last run."""
FILE_ONCE = FILE | {"options": FILE["options"] | ONCE["options"]}

_running: list["Stepwise"] = []
"""The operator that is working over several slices, one at most."""


def stop() -> None:
    """End the running work when the add-on is disabled: Blender removes the operator without telling it."""
    if _running:
        _running[0].cancel(bpy.context)


class Hardened:
    """Reports what is wrong instead of raising; `work(context)` returns a message or None."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        return self.guarded(lambda: self.work(context))

    def guarded(self, function):
        """Run it; a user's error becomes a report, and so does any other error, with its traceback on the console."""
        try:
            message = function()
        except NeuralocksError as error:
            self.report({"ERROR"}, for_the_panel(str(error)))
            return {"CANCELLED"}
        except ReferenceError:
            self.report({"ERROR"}, "Neuralocks: something that this needs was deleted or undone meanwhile; start again")
            return {"CANCELLED"}
        except Exception as error:
            traceback.print_exc()
            self.report(
                {"ERROR"},
                f"Neuralocks: unexpected {type(error).__name__}: {error}; please report this with the console's text",
            )
            return {"CANCELLED"}
        if message:
            self.report({"INFO"}, message)
        return {"FINISHED"}


class Stepwise(Hardened):
    """Long work as a generator `steps(context)` of (done, total, message): at once from scripts, with progress and
    Esc from the panel.

    Between two slices, when the artist may do anything, the scene is at the artist's frame.
    """

    def work(self, context):
        """All at once."""
        steps = self.steps(context)
        try:
            while True:
                next(steps)
        except StopIteration as end:
            return end.value

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        if session.working:
            self.report({"ERROR"}, f"Neuralocks: {session.working} is still running; wait for it, or press Esc")
            return {"CANCELLED"}
        self._steps, self._left = self.steps(context), TimeLeft()
        session.working = self.bl_label
        _running[:] = [self]
        background.request()  # a half-done sampling starts anew afterwards
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.01, window=context.window)
        manager.progress_begin(0, 1000)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._close()
            self._end(context)
            self.report({"WARNING"}, "Cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        self._done = False
        result = self.guarded(lambda: self._slice(context))
        if result == {"CANCELLED"} or self._done:
            self._end(context)
            return result
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        """Blender ends the work itself, when another file is opened or the window closes."""
        self._close()
        self._finish(context)

    def _close(self):
        try:
            self._steps.close()
        except ReferenceError:  # what would be restored is gone
            pass

    def _slice(self, context):
        end = time.perf_counter() + SLICE
        try:
            done, total, message = next(self._steps)
            while time.perf_counter() < end:
                done, total, message = next(self._steps)
            share = done / max(total, 1)
            self._left.told(share)
            context.window_manager.progress_update(1000 * share)
            left = in_words(self._left.seconds)
            context.workspace.status_text_set(f"{message}  {100 * share:.0f} %{left}   Esc: cancel")
        except StopIteration as stop:
            self._done = True
            return stop.value
        return None

    def _end(self, context):
        self._finish(context)
        refresh(context.scene)  # with what was sampled

    def _finish(self, context):
        session.working = ""
        _running.clear()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        for workspace in bpy.data.workspaces:  # another one may be shown by now
            workspace.status_text_set(None)
        session.sampling.done = None


def sampling(context, armature, share: float = 1.0):
    """Steps (done, total, message) of sampling an armature's motion, the first `share` of longer work; in one go if nobody can do
    anything meanwhile. Returns its `SampledRig`.
    """
    name = armature.name_full
    for done, total in in_slices(context, armature, SAMPLED if _running else math.inf):
        yield share * done, total, f"Sampling the motion of {name}"
    return session.rigs[name]


def sampled_once(context, armature):
    """The same, but only if the motion is not sampled yet, or stale."""
    found = known(armature, context.scene)
    return found if found is not None else (yield from sampling(context, armature))


def tell(operator, message: str, notes: list[str]) -> None:
    """Report how it ended, and then other notes: Blender shows the last line longest."""
    operator.report({"INFO"}, message)
    for note in notes:
        operator.report({"WARNING"}, note)


def shown_armature(context):
    """The armature that the panel shows.

    Raises:
        NeuralocksError: there is none, or it is from a library that was not found.
    """
    armature = context.scene.neuralocks.armature
    if armature is not None:
        check_found(armature)
    if armature is None or not in_scene(armature, context.scene):
        raise NeuralocksError("Character: no armature chosen; choose the armature of your character in the panel")
    return armature


def shown_hair(context, armature=None):
    """The hair object that the panel shows; of this armature, if one is given.

    Raises:
        NeuralocksError: there is none, it was converted to another type, or it belongs to another character.
    """
    hair = context.scene.neuralocks.hair
    if hair is None or not in_scene(hair, context.scene):
        raise NeuralocksError("Strands: no hair chosen; choose a hair Curves object, or convert a particle system")
    if hair.type != "CURVES":
        raise NeuralocksError(
            f"{hair.name_full}: it is no longer a hair Curves object; choose another one in the panel"
        )
    carrier = hair.neuralocks_hair.armature
    if armature is not None and carrier != armature:
        other = "" if carrier is None else f"choose {carrier.name_full} above, or "
        raise NeuralocksError(
            f"{hair.name_full}: it belongs to {'no' if carrier is None else 'another'} character; {other}press Attach to "
            f"Character to give it to {armature.name_full}"
        )
    return hair
