# SPDX-License-Identifier: GPL-3.0-or-later
"""Strands: hair Curves from a particle system, resetting the look, attaching to a character."""

import bpy
from bpy.props import BoolProperty, StringProperty

from ..live.live_strands import show_rest
from ..live.view import refresh
from ..scene import particles
from ..scene.character.binding import carrier
from ..scene.files.paths import check_own
from ..scene.hair import imported
from ..services.panel.sliders import SLIDERS
from ..services.work.threaded import loading
from ..session import session
from .base import ONCE, Hardened, Stepwise, shown_armature, shown_hair


class NEURALOCKS_OT_from_particles(Hardened, bpy.types.Operator):
    """Make a hair Curves object from particle hair of the active object, with all its key points and its children"""

    bl_idname = "neuralocks.from_particles"
    bl_label = "Convert Particle Hair"

    system: StringProperty(
        name="System",
        description="Name of the particle system; if empty, the active one, or the next that is not converted yet",
        **ONCE,
    )
    children: BoolProperty(
        name="Children",
        description="Make strands of its children, too, as many as are rendered",
        default=True,
    )

    def work(self, context):
        source, system = particles.choose(context, self.system)
        hair = particles.convert(context, source, system, self.children)
        settings = context.scene.neuralocks
        settings.hair = hair
        hair.neuralocks_hair.armature = carrier(source, settings.armature)
        left = [f"'{other.name}'" for other in particles.waiting(source)]
        more = f"; {', '.join(left)} not converted yet" if left else ""
        return f"{hair.name_full}: {len(hair.data.curves)} strands from the particle hair of {source.name}{more}"


class NEURALOCKS_OT_reset_look(Hardened, bpy.types.Operator):
    """Reset all sliders to average"""

    bl_idname = "neuralocks.reset_look"
    bl_label = "Reset Hair Look"

    def work(self, context):
        hair = shown_hair(context)
        check_own(hair)
        settings = hair.neuralocks_hair
        for slider in SLIDERS:
            settings.property_unset(slider.name)
        refresh(context.scene)


class NEURALOCKS_OT_assign(Hardened, bpy.types.Operator):
    """Attach this hair to the character shown above"""

    bl_idname = "neuralocks.assign"
    bl_label = "Attach to Character"

    def work(self, context):
        hair, armature = shown_hair(context), shown_armature(context)
        check_own(hair)
        hair.neuralocks_hair.armature = armature
        return f"{hair.name_full} belongs to {armature.name_full}"


class NEURALOCKS_OT_rest_from_file(Stepwise, bpy.types.Operator):
    """Give hair that was imported with its motion the rest shape that its USD file has. Hair that was edited since stays as it is"""

    bl_idname = "neuralocks.rest_from_file"
    bl_label = "Rest Shape from File"

    def steps(self, context):
        yield from loading("usd.shot.strands.imported")
        hair = shown_hair(context)
        check_own(hair)
        path = imported.take_rest(hair)
        session.forget(hair.name_full)
        show_rest(hair)
        refresh(context.scene)
        return f"{hair.name_full}: has the rest shape of {path}"


CLASSES = (
    NEURALOCKS_OT_from_particles,
    NEURALOCKS_OT_reset_look,
    NEURALOCKS_OT_assign,
    NEURALOCKS_OT_rest_from_file,
)
