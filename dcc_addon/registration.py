# SPDX-License-Identifier: GPL-3.0-or-later
"""All that the add-on registers in Blender, and unregisters again, in one place."""

import bpy

from . import background, handlers, operators
from .interface import menu, panels, preferences, properties
from .live import live_rig, live_strands, preparing
from .scene.objects.live_objects import lively
from .session import session

CLASSES = (*properties.CLASSES, *preferences.CLASSES, *operators.CLASSES, *panels.CLASSES, *menu.CLASSES)


def register() -> None:
    """Enable the add-on."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    properties.attach()
    menu.attach()
    handlers.attach()
    if hasattr(bpy.data, "scenes"):  # while Blender starts, no file is open yet; loading one calls the handler
        handlers.on_load()


def unregister() -> None:
    """Disable it: hair at rest, no handler, timer, process or class left behind."""
    operators.base.stop()
    background.cancel()
    preparing.stop()
    operators.training.stop()
    handlers.detach()
    for scene in bpy.data.scenes:
        own = lively(scene.objects)
        for hair in own.hairs:
            live_strands.rest(hair)
        for armature in own.armatures:
            live_rig.rest(armature)
    live_strands.show_all_rest()
    session.clear()
    menu.detach()
    properties.detach()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
