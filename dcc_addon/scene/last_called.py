# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers that Blender calls after it has evaluated a frame. Other add-ons may pose a rig in them: Blender then evaluates
again, but calls no handler.
"""

import bpy


def go_last(handler) -> None:
    """Let this one of those that are called after a frame change be the last; not while they are being called, or one of
    them goes without.
    """
    calls = bpy.app.handlers.frame_change_post
    if handler in calls and calls[-1] != handler:
        calls.remove(handler)
        calls.append(handler)


def others_called() -> bool:
    """Whether anybody else is called after a frame change."""
    return len(bpy.app.handlers.frame_change_post) > 1
