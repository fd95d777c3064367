# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the character, checking its rig, sampling its motion."""

import bpy

from neuralocks_core.errors import NeuralocksError

from ..live.view import refresh
from ..scene.character import armature as armature_reader
from ..scene.character.binding import carrier
from ..scene.character.body import find, left_behind
from ..scene.character.carried import bodies_of
from ..scene.files.paths import check_own
from ..scene.objects.instances import check_real
from ..services.rigs import rig as rig_service
from .base import Hardened, Stepwise, sampling, shown_armature


class NEURALOCKS_OT_find(Hardened, bpy.types.Operator):
    """Take the character and the hair from the selection, or those in the scene that belong together"""

    bl_idname = "neuralocks.find"
    bl_label = "Find Character and Hair"

    def work(self, context):
        settings, scene = context.scene.neuralocks, context.scene
        # An override comes before the linked object that it overrides, which may be in the scene too.
        local = sorted(scene.objects, key=lambda thing: thing.library is not None)
        layer = context.view_layer  # a script may run without a window, which alone has `selected_objects`
        selected = [thing for thing in layer.objects.selected if thing.visible_get(view_layer=layer)]
        chosen = [*selected, *local]
        armatures, hairs = ([o for o in chosen if o.type == kind] for kind in ("ARMATURE", "CURVES"))
        if not any(thing.type == "ARMATURE" for thing in selected):
            check_real(selected if armatures else [*selected, *local])
        if not armatures:
            raise NeuralocksError("Character: this scene has no armature; add or import the rig of your character")
        armature = _character(armatures, hairs, selected, scene)
        hair = hairs[0] if hairs and hairs[0] in selected else _hair(hairs, armature, armatures)
        settings.armature, settings.hair = armature, hair
        if hair is not None and hair.neuralocks_hair.armature is None:
            check_own(hair)
            hair.neuralocks_hair.armature = _carrier(hair, armature)
        none = "no hair of its own" if hairs else "no hair Curves in this scene"
        return f"Character {armature.name_full}, {f'hair {hair.name_full}' if hair else none}"


def _character(armatures, hairs, selected, scene):
    """The armature that is selected, or carries selected hair or a mesh; otherwise the first in the scene that carries hair, that
    deforms a mesh, or the first of all: a rig's template may be beside it.
    """
    if armatures[0] in selected:
        return armatures[0]
    carried = [_carrier(thing) for kind in ("CURVES", "MESH") for thing in selected if thing.type == kind]
    with_hair = [_carrier(hair) for hair in hairs]
    found = [a for a in armatures if a in with_hair] or [a for a in armatures if find(a, scene)] or armatures
    return next(a for a in [*carried, *found] if a in armatures)


def _hair(hairs, armature, armatures):
    """The first hair of an armature, otherwise the first that has no armature; None if all hair is that of others."""
    others = {other for other in armatures if other != armature}
    free = [hair for hair in hairs if _carrier(hair, armature) not in others]
    return next(iter(sorted(free, key=lambda hair: _carrier(hair) != armature)), None)


def _carrier(thing, shown=None):
    """The armature that a hair object belongs to, or that moves it or a mesh; the one `shown` if that does, or none does."""
    return thing.neuralocks_hair.armature or carrier(thing, shown)


class NEURALOCKS_OT_check(Hardened, bpy.types.Operator):
    """Check the rig: which bone is which, and what may spoil the hair"""

    bl_idname = "neuralocks.check"
    bl_label = "Check Rig"
    bl_options = {"REGISTER"}

    def work(self, context):
        armature = shown_armature(context)
        rig = armature_reader.read(armature, armature.neuralocks_character.head_bone)
        behind = (left_behind(body, armature) for body in bodies_of(armature, context.scene))
        lines = [*rig_service.advice(rig), *filter(None, behind)]
        for line in lines:
            self.report({"WARNING"}, line)
        return None if lines else f"{armature.name_full}: the rig is fine"


class NEURALOCKS_OT_sample(Stepwise, bpy.types.Operator):
    """Step through the frames once and remember how the rig moves, with constraints, IK, drivers and NLA"""

    bl_idname = "neuralocks.sample_motion"
    bl_label = "Sample Motion"
    bl_options = {"REGISTER"}

    def steps(self, context):
        armature = shown_armature(context)
        name = armature.name_full
        yield from sampling(context, armature)
        return f"{name}: motion sampled"

    def execute(self, context):
        result = super().execute(context)
        refresh(context.scene, wait=True)
        return result


CLASSES = (NEURALOCKS_OT_find, NEURALOCKS_OT_check, NEURALOCKS_OT_sample)
