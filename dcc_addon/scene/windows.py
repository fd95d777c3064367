# SPDX-License-Identifier: GPL-3.0-or-later
"""What the windows show: each has a scene of its own, and a timer's context names only one of them."""

import bpy


def scenes_shown() -> list:
    """The scene of the context, and those of all windows."""
    windows = bpy.context.window_manager.windows
    return list(dict.fromkeys([bpy.context.scene, *(window.scene for window in windows)]))


def layer_shown(scene):
    """The view layer in which a scene is shown, the first where it is not; whether hair moves in it is seen to where that
    is read.
    """
    if scene == bpy.context.scene:
        return bpy.context.view_layer
    windows = bpy.context.window_manager.windows
    return next((window.view_layer for window in windows if window.scene == scene), scene.view_layers[0])
