# SPDX-License-Identifier: GPL-3.0-or-later
"""What is saved with Blender's preferences, for all files."""

import bpy
from bpy.props import StringProperty

from ..operators.training import known_problem
from .labels import words


class Preferences(bpy.types.AddonPreferences):
    """Where training runs: torch is too large to ship, and is not needed for anything else."""

    bl_idname = __package__.rsplit(".", 1)[0]

    python: StringProperty(
        name="Python for Training",
        description="A Python with torch, in which Neuralocks trains",
        subtype="FILE_PATH",
    )

    def draw(self, _context):
        column = self.layout.column()
        column.prop(self, "python")
        problem = known_problem()
        if problem is None:
            column.label(text="Checking what training needs", icon="TIME")
        else:
            words(column, problem or "Ready to train", "INFO" if problem else "CHECKMARK")
        if problem:
            column.operator("neuralocks.copy_install", icon="COPYDOWN")


CLASSES = (Preferences,)
