# SPDX-License-Identifier: GPL-3.0-or-later
"""Strands: hair Curves from a particle system, settings, report card."""

import bpy
from bpy.props import StringProperty

from neuralocks_core.errors import NeuralocksError

from ..scene import particles
from ..scene.attach import check_own
from .base import Hardened, shown_armature, shown_hair


class NEURALOCKS_OT_from_particles(Hardened, bpy.types.Operator):
    """Make a hair Curves object from the hair particle system of the active object, with all its key points"""

    bl_idname = "neuralocks.from_particles"
    bl_label = "Convert Particle Hair"

    system: StringProperty(name="System", description="Name of the particle system; the active one when empty")

    def work(self, context):
        source = context.active_object
        if source is None or not source.particle_systems:
            source = next((o for o in context.scene.objects if o.particle_systems), None)
        if source is None:
            raise NeuralocksError(
                "Particle hair: no object of this scene has a particle system; select the one with the hair"
            )
        hair = particles.convert(context, source, self.system)
        settings = context.scene.neuralocks
        settings.hair = hair
        if settings.armature is not None:
            hair.neuralocks_hair.armature = settings.armature
        return f"{hair.name_full}: {len(hair.data.curves)} strands from the particle hair of {source.name}"


class NEURALOCKS_OT_reset_look(Hardened, bpy.types.Operator):
    """Put stiffness, weight, damping, clumping and motion back to average"""

    bl_idname = "neuralocks.reset_look"
    bl_label = "Reset Hair Look"

    def work(self, context):
        settings = shown_hair(context).neuralocks_hair
        for name in ("bend", "weight", "damping", "clumping", "motion"):
            settings.property_unset(name)
        from ..live import refresh

        refresh(context.scene)


class NEURALOCKS_OT_assign(Hardened, bpy.types.Operator):
    """Let the character shown above carry this hair"""

    bl_idname = "neuralocks.assign"
    bl_label = "Attach to Character"

    def work(self, context):
        hair, armature = shown_hair(context), shown_armature(context)
        check_own(hair)
        hair.neuralocks_hair.armature = armature
        return f"{hair.name_full} belongs to {armature.name_full}"


CLASSES = (NEURALOCKS_OT_from_particles, NEURALOCKS_OT_reset_look, NEURALOCKS_OT_assign)
