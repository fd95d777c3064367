# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators in a menu of the 3D viewport: Blender's search (F3) looks into menus, not into sidebars."""

import bpy

from .. import operators

PLACES = ("VIEW3D_MT_object", "VIEW3D_MT_pose", "VIEW3D_MT_edit_curves", "VIEW3D_MT_sculpt_curves")


class NEURALOCKS_MT_menu(bpy.types.Menu):
    """Hair that moves with the character"""

    bl_label = "Neuralocks"

    def draw(self, _context):
        for cls in operators.CLASSES:
            self.layout.operator(cls.bl_idname)
        self.layout.operator("neuralocks.train", text="Train Hair Bones for This Character").kind = "rig"


CLASSES = (NEURALOCKS_MT_menu,)


def draw(menu, _context) -> None:
    """Draw the entry in a menu of Blender."""
    menu.layout.separator()
    menu.layout.menu(NEURALOCKS_MT_menu.__name__)


def attach() -> None:
    """Add the menu to those of the modes of a character and of its hair; some are newer than the oldest Blender."""
    for place in PLACES:
        if hasattr(bpy.types, place):
            getattr(bpy.types, place).append(draw)


def detach() -> None:
    """Remove it again."""
    for place in PLACES:
        if hasattr(bpy.types, place):
            getattr(bpy.types, place).remove(draw)
