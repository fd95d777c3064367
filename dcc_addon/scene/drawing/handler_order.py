# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers that Blender calls after it has evaluated a frame. Other add-ons may pose a rig in them: Blender then evaluates
again, but calls no handler.
"""

import bpy


def go_last(handler) -> None:
    """Make this handler the last of those called after a frame change; not while they are being called, or one of them would be
    skipped.
    """
    calls = bpy.app.handlers.frame_change_post
    if handler in calls and calls[-1] != handler:
        calls.remove(handler)
        calls.append(handler)


def others_called() -> bool:
    """Whether any other handler is called after a frame change."""
    return len(bpy.app.handlers.frame_change_post) > 1
