# SPDX-License-Identifier: GPL-3.0-or-later
"""Redrawing the panel while work runs in the background."""

import bpy


def redraw() -> None:
    """Redraw every 3D viewport with its sidebar, and the preferences, which say what training lacks."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type in ("VIEW_3D", "PREFERENCES"):
                area.tag_redraw()
