# SPDX-License-Identifier: GPL-3.0-or-later
"""What all operators share: errors as reports, and long work with progress and cancel."""

import threading
import time
import traceback

import bpy

from neuralocks_core.errors import NeuralocksError

from ..scene.sampling import stepping
from ..session import session

SLICE = 0.06
"""Longest time between two chances to cancel [s]."""


class Hardened:
    """Reports what is wrong instead of raising; `work(context)` returns a message or None."""

    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        return self.guarded(lambda: self.work(context))

    def guarded(self, function):
        """Run it; a user's error becomes a report, any other one too, with its traceback on the console."""
        try:
            message = function()
        except NeuralocksError as error:
            self.report({"ERROR"}, str(error))
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

    A subclass with `steps_frames = True` moves the scene's frame; the frame comes back between slices and at the end.
    """

    steps_frames = False

    def work(self, context):
        """All at once."""
        if not self.steps_frames:
            return self._drain(self.steps(context))
        with stepping(context.scene):
            return self._drain(self.steps(context))

    def _drain(self, steps):
        try:
            while True:
                next(steps)
        except StopIteration as end:
            return end.value

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        self._steps = None
        problem = self.guarded(lambda: setattr(self, "_steps", self.steps(context)))
        if problem == {"CANCELLED"}:
            return problem
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.01, window=context.window)
        manager.progress_begin(0, 1000)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._steps.close()
            self._finish(context)
            self.report({"WARNING"}, "Cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        self._message, self._done = None, False
        if self.steps_frames:
            with stepping(context.scene):
                result = self.guarded(lambda: self._slice(context))
        else:
            result = self.guarded(lambda: self._slice(context))
        if result == {"CANCELLED"} or self._done:
            self._finish(context)
            return result
        return {"RUNNING_MODAL"}

    def _slice(self, context):
        end = time.perf_counter() + SLICE
        try:
            while time.perf_counter() < end:
                done, total, message = next(self._steps)
            context.window_manager.progress_update(1000 * done / max(total, 1))
            context.workspace.status_text_set(f"{message}  {100 * done / max(total, 1):.0f} %   Esc: cancel")
        except StopIteration as stop:
            self._done = True
            return stop.value
        return None

    def _finish(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        session.sampling = None


class Threaded:
    """Work in a thread of its own, so that the panel can show progress and cancel; it calls nothing of Blender.

    Args:
        function: called with a progress callback that raises once the work is cancelled.
        title: what is being done.
        leave: do not wait for the thread after a cancel; for work that ends by itself and writes nothing.
    """

    def __init__(self, function, title: str = "Baking the hair", leave: bool = False):
        self._function, self._title, self._leave = function, title, leave

    def steps(self, parts: int, part: int):
        """Yields (done, total, title) while it works, as part `part` of `parts` of the second half; returns its result."""
        state = {"done": (0, 1, ""), "cancel": False}

        def say(done, total, message):
            if state["cancel"]:
                raise NeuralocksError("cancelled")
            state["done"] = done, total, message

        def run():
            try:
                state["result"] = self._function(say)
            except BaseException as error:
                state["error"] = error

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        try:
            while thread.is_alive():
                thread.join(0.02)
                done, total, _ = state["done"]
                share = (part + done / max(total, 1)) / parts
                yield 0.5 + 0.5 * share, 1, self._title
        finally:
            state["cancel"] = True
            if not self._leave:
                thread.join()
        if "error" in state:
            raise state["error"]
        return state["result"]


def shown_armature(context):
    """The armature that the panel shows.

    Raises:
        NeuralocksError: there is none.
    """
    armature = context.scene.neuralocks.armature
    if armature is None or armature.name not in context.scene.objects:
        raise NeuralocksError("Character: no armature chosen; choose the armature of your character in the panel")
    return armature


def shown_hair(context):
    """The hair object that the panel shows.

    Raises:
        NeuralocksError: there is none.
    """
    hair = context.scene.neuralocks.hair
    if hair is None or hair.name not in context.scene.objects:
        raise NeuralocksError("Strands: no hair chosen; choose a hair Curves object, or convert a particle system")
    return hair
