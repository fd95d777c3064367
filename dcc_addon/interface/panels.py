# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar tab, in the order in which an artist works: character, strands, hair bones, bake."""

import bpy

from neuralocks_core.character import HEAD_WIDTHS
from neuralocks_core.motion import LOOP_GAP

from ..operators.training import job, known_problem, notes
from ..scene.baked import attach, bone_record
from ..scene.character.body import left_behind
from ..scene.character.examined import examined
from ..scene.files.paths import usual_output
from ..scene.hair import imported
from ..scene.keys import hair_keys
from ..scene.motion.dependencies import begins_later, frames_of
from ..scene.particles import waiting
from ..services.panel.panel_errors import for_the_panel
from ..services.panel.remaining import in_words
from ..services.panel.sliders import SLIDERS
from ..services.rigs.rig import advice
from ..session import session
from .hair_notes import hair_notes, unnamed_model
from .labels import hint, message, progress, words

LATER = (
    "it knows no motion before it. To render a part of a shot again, turn off Scene Range in the panel Bake, and name the "
    "whole shot there"
)


class _Panel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Neuralocks"


class NEURALOCKS_PT_character(_Panel, bpy.types.Panel):
    """The character that carries the hair"""

    bl_label = "Character"

    def draw(self, context):
        layout, settings = self.layout, context.scene.neuralocks
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "armature")
        armature = settings.armature
        if armature is None:
            layout.operator("neuralocks.find", icon="VIEWZOOM")
            return
        character = armature.neuralocks_character
        layout.prop(character, "body")
        layout.prop_search(character, "head_bone", armature.data, "bones")
        lines, problem = findings(armature)
        for line in lines:
            words(layout, line, "INFO")
        if problem:
            words(layout, problem, "ERROR")
        _motion(layout, armature, context.scene)


def _motion(layout, armature, scene) -> None:
    """How up to date the sampled motion is; in few words, because a narrow sidebar cuts labels beside buttons."""
    sampled, character = session.rigs.get(armature.name_full), armature.neuralocks_character
    if sampled is not None and character.body is None and sampled.bodies:
        words(layout, f"Body: {', '.join(sampled.bodies)}", "INFO")
    row = layout.row()
    if session.sampling.done is not None:
        row.label(text=f"Sampling {100 * session.sampling.done:.0f} %", icon="TIME")
    elif sampled is None:
        row.label(text="Not sampled", icon="QUESTION")
    elif sampled.stale:
        row.label(text="Out of date", icon="ERROR")
    else:
        row.label(text=f"{len(sampled.motion.frames)} frames", icon="CHECKMARK")
    row.prop(character, "loop", text="", icon="LOOP_FORWARDS")
    row.operator("neuralocks.sample_motion", text="", icon="FILE_REFRESH")
    if sampled is not None:
        width = sampled.character.head_width
        if width is not None and not HEAD_WIDTHS[0] < width < HEAD_WIDTHS[1]:
            text = f"The head is {width:.2g} m wide; check the scene's Unit Scale or the armature's scale"
            words(layout, text, "ERROR")
        first, last = sampled.motion.frames[[0, -1]]
        if character.loop and (gap := sampled.motion.gap) > LOOP_GAP:
            words(layout, f"Frame {last:g} differs from frame {first:g} by {gap:.0f} degrees", "ERROR")
        if not character.loop and not first <= scene.frame_current <= last:
            text = f"Hair only knows the motion of frames {first:g} to {last:g}; widen the scene's range"
            words(layout, text, "INFO")
    if not character.loop and begins_later(scene):
        words(layout, f"Hair begins at rest at frame {frames_of(scene)[0]}: {LATER}", "INFO")
    if sampled is not None:
        for text in (*(() if character.loop else sampled.leaps), *sampled.bodies_off, *sampled.hairs_off.values()):
            words(layout, text, "INFO")
    if text := session.said.misrendered.get(armature.name_full):
        words(layout, text, "ERROR")
    message(layout, armature.name_full)


class NEURALOCKS_PT_wind(_Panel, bpy.types.Panel):
    """The wind in this character's hair"""

    bl_label = "Wind"
    bl_parent_id = "NEURALOCKS_PT_character"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.scene.neuralocks.armature is not None

    def draw(self, context):
        layout, armature = self.layout, context.scene.neuralocks.armature
        layout.use_property_split, layout.use_property_decorate = True, False
        own = armature.neuralocks_character
        layout.prop(own, "wind", slider=True, text="Strength")
        column = layout.column()
        column.active = own.wind > 0
        column.prop(own, "wind_direction")
        column.prop(own, "gusts")
        bound = session.chains.get(armature.name_full)
        if own.wind > 0 and bound is not None and not bound.bones.model.feels_wind:
            words(layout, "The model of the hair bones is for held poses, so they feel no wind", "INFO")


class NEURALOCKS_PT_strands(_Panel, bpy.types.Panel):
    """Strand hair"""

    bl_label = "Strands"

    def draw(self, context):
        layout, settings = self.layout, context.scene.neuralocks
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "hair")
        hair = settings.hair
        if hair is None or (context.active_object is not None and waiting(context.active_object)):
            layout.operator("neuralocks.from_particles", icon="PARTICLES")
        if hair is None:
            return
        if hair.type != "CURVES":
            words(layout, f"{hair.name_full} is no longer a hair Curves object; choose another one", "ERROR")
            return
        own = hair.neuralocks_hair
        if own.armature is None or own.armature != settings.armature:
            if own.armature is not None:
                words(layout, f"This hair belongs to {own.armature.name_full}", "INFO")
            layout.operator("neuralocks.assign", icon="LINKED")
        layout.prop(own, "model", **hint(unnamed_model(hair)))
        _training(layout, settings, "strands")
        _switch(layout, own, "live")
        if hair.name_full in session.preparing:
            done = session.preparing[hair.name_full][0].done
            progress(layout, done, f"Preparing {100 * done:.0f} %, Live cancels")
        message(layout, hair.name_full)
        for text in hair_notes(hair, context.scene):
            words(layout, text, "INFO")
        if own.armature is not None and imported.has_file(hair):
            layout.operator("neuralocks.rest_from_file", icon="IMPORT")
        column = layout.column(align=True)
        for slider in SLIDERS:
            column.prop(own, slider.name, slider=True)
        row = layout.row()
        row.use_property_split = False
        row.prop(own, "resolve")
        sampled = session.rigs.get(own.armature.name_full) if own.armature is not None else None
        if own.resolve and sampled is not None and sampled.character.body is None:
            words(layout, "No body mesh found; choose it above", "INFO")
        layout.operator("neuralocks.reset_look", text="Reset", icon="LOOP_BACK")
        layout.operator("neuralocks.report_card", text="Report Card", icon="PRESET")
        for line in session.said.cards.get(hair.name_full, ()):
            words(layout, line, "NONE")


def _switch(layout, own, name: str) -> None:
    """The large button of a Live setting."""
    row = layout.row()
    row.scale_y = 1.5
    row.use_property_split = False
    row.prop(own, name, toggle=True, icon="PAUSE" if getattr(own, name) else "PLAY")


def _training(layout, settings, kind: str) -> None:
    running = job()
    if running is None:
        column = layout.column(align=True)
        column.operator("neuralocks.train", icon="MODIFIER").kind = kind
        column.prop(settings, "train_minutes")
        if problem := known_problem():
            words(layout, problem, "INFO")
            layout.operator("neuralocks.copy_install", icon="COPYDOWN")
        if session.said.trained is not None:
            text, well = session.said.trained
            words(layout, for_the_panel(text), "CHECKMARK" if well else "ERROR")
        _notes(layout)
        return
    box = layout.box()
    progress(box, running.done, f"Training {100 * running.done:.0f} %{in_words(running.seconds_left)}")
    # What is below keeps its place when the numbers, and so perhaps the line count, change.
    running.lines = max(running.lines, words(box, running.message, "NONE", running.lines))
    _notes(box)
    box.operator("neuralocks.cancel_training", icon="CANCEL")


def _notes(layout) -> None:
    """Training's notes on the character, some of which can save its minutes."""
    for note in notes():
        words(layout, note, "INFO")


class NEURALOCKS_PT_rig(_Panel, bpy.types.Panel):
    """Hair made of bones"""

    bl_label = "Rigged Hair"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, settings = self.layout, context.scene.neuralocks
        layout.use_property_split, layout.use_property_decorate = True, False
        armature = settings.armature
        if armature is None:
            layout.label(text="Choose a character first", icon="INFO")
            return
        own = armature.neuralocks_character
        layout.prop(own, "chains", **hint("Found automatically"))
        layout.operator("neuralocks.find_chains", icon="BONE_DATA")
        for line in session.said.cards.get(armature.name_full, ()):
            words(layout, line, "NONE")
        layout.prop(own, "rig_model", **hint("Shipped with the add-on"))
        _training(layout, settings, "rig")
        _switch(layout, own, "rig_live")
        layout.prop(own, "rig_motion", slider=True)
        message(layout, armature.name_full)
        row = layout.row(align=True)
        row.operator("neuralocks.bake_keys", text="Bake to Keyframes", icon="KEYINGSET")
        taking = row.row(align=True)
        taking.enabled = hair_keys.has_keys(armature)
        taking.operator("neuralocks.remove_keys", text="", icon="X")
        if text := bone_record.changed_since(armature, context.scene):
            words(layout, f"{armature.name_full}: {text}", "ERROR")
        if text := bone_record.note(armature, context.scene):
            words(layout, text, "INFO")
        column = layout.column(align=True)  # side by side, a sidebar of default width would cut them
        column.operator("neuralocks.export_skel", text="USD Animation", icon="EXPORT")
        column.operator("neuralocks.export_c", text="C Header", icon="FILE_SCRIPT")


class NEURALOCKS_PT_bake(_Panel, bpy.types.Panel):
    """Moving hair as a file"""

    bl_label = "Bake"

    def draw(self, context):
        layout, settings = self.layout, context.scene.neuralocks
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.prop(settings, "use_scene_range")
        if not settings.use_scene_range:
            column = layout.column(align=True)
            column.prop(settings, "frame_start")
            column.prop(settings, "frame_end")
        layout.prop(settings, "subframes")
        layout.prop(settings, "output", **hint(usual_output()))
        if not bpy.data.filepath and (not settings.output.strip() or settings.output.startswith("//")):
            words(layout, "Save this file first, or choose a full path", "INFO")
        layout.operator("neuralocks.bake", icon="EXPORT")
        row = layout.row(align=True)
        row.operator("neuralocks.bake_attach", icon="LINKED")
        taking = row.row(align=True)
        hair = settings.hair
        taking.enabled = hair is not None and (attach.has_cache(hair) or bool(hair.neuralocks_hair.replaced))
        taking.operator("neuralocks.detach", text="", icon="X")
        if hair is not None and not hair.neuralocks_hair.live:
            if text := attach.changed_since(hair, context.scene):
                words(layout, f"{hair.name_full}: {text}", "ERROR")


def findings(armature) -> tuple[list[str], str]:
    """What is found in the rig, and what is wrong with it or with the chosen body."""
    (rig, head, problem), body = examined(armature), armature.neuralocks_character.body
    if not problem and body is not None:
        problem = left_behind(body, armature)
    if rig is None:
        return [], problem
    reason = rig.humanoid.reasons["head"]
    why = "" if reason.startswith(("by name", "given")) else f" ({reason})"
    return [f"Head: {rig.bones[head]}{why}", *advice(rig)], problem


CLASSES = (NEURALOCKS_PT_character, NEURALOCKS_PT_wind, NEURALOCKS_PT_strands, NEURALOCKS_PT_rig, NEURALOCKS_PT_bake)
