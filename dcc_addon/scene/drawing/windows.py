# SPDX-License-Identifier: GPL-3.0-or-later
"""What the windows show: each has its own scene, and a timer's context names only one of them."""

import bpy

from .other_scenes import homes


def scenes_shown() -> list:
    """The scene of the context and those of all windows, then the scenes whose characters they draw."""
    windows = bpy.context.window_manager.windows
    found = [bpy.context.scene, *(window.scene for window in windows)]
    return list(dict.fromkeys([*found, *(home for scene in found for home in homes(scene))]))


def drawing(scene) -> list:
    """The scene, and shown scenes that draw one of its characters; last the one in view."""
    return in_view_last({scene, *(shown for shown in scenes_shown() if scene in homes(shown))})


def in_view_last(scenes) -> list:
    """Scenes in an order in which hair that is in several of them ends as the scene in view shows it."""
    return sorted(scenes, key=lambda scene: scene == bpy.context.scene)


def layer_shown(scene):
    """The view layer in which a scene is shown, or the first if it is not; callers check whether hair moves in it."""
    if scene == bpy.context.scene:
        return bpy.context.view_layer
    windows = bpy.context.window_manager.windows
    return next((window.view_layer for window in windows if window.scene == scene), scene.view_layers[0])
