# SPDX-License-Identifier: GPL-3.0-or-later
"""Preparing hair in a thread: a large groom takes a second, during which Blender stays usable."""

import bpy

from ..scene.drawing.redraw import redraw
from ..services.work.threaded import Threaded
from ..session import session

LOOK = 0.05
"""Time between two looks at what is being prepared [s]."""


def start(name: str, make, then) -> None:
    """Let a thread prepare a hair object.

    Args:
        name: of the hair object.
        make: called with a progress callback, returns the prepared hair; does not call Blender.
        then: called with the name when the hair is in the session.
    """
    session.preparing[name] = Threaded(make, leave=True).start(), then
    if not bpy.app.timers.is_registered(look):
        bpy.app.timers.register(look, first_interval=LOOK)


def stop() -> None:
    """Cancel all; the session drops their results."""
    session.stop_preparing_all()
    if bpy.app.timers.is_registered(look):
        bpy.app.timers.unregister(look)


def look() -> float | None:
    """Take over what is ready; the time until the next look, None once nothing is being prepared."""
    for name, entry in list(session.preparing.items()):
        job, then = entry
        if job.running or session.preparing.get(name) is not entry:  # showing one may have stopped or begun others
            continue
        del session.preparing[name]
        try:
            session.hairs[name] = job.result()
            then(name)
        except Exception as error:
            session.said.tell(name, error)
    redraw()
    return LOOK if session.preparing else None
