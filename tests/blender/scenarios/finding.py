# SPDX-License-Identifier: GPL-3.0-or-later
"""The character and the hair that belong together, among others in the scene."""

from pathlib import Path
from unittest import SkipTest

import bpy
import numpy as np
from mathutils import Vector

from dcc_addon.session import session
from tests.blender import scenes
from tests.blender.checks import choose


def found_together(_folder: Path) -> None:
    """The template that Rigify leaves in the scene, and other rigs, are not mistaken for the rig that carries the hair or the
    selected skin; and a rig does not get another's hair.
    """
    metarig, rig, other = (scenes.armature(name) for name in ("A template", "Rig", "Zoe"))
    assert _found(None) == (metarig, None)
    skin, coat = scenes.body(rig), scenes.body(other)
    assert _found(None) == (rig, None)
    hair = scenes.hair(other, 5, name="Locks")
    assert _found(None) == (other, hair) and _found(coat) == (other, hair) and _found(hair) == (other, hair)
    assert _found(skin) == (rig, None) and _found(metarig) == (metarig, None)
    assert bpy.context.scene.neuralocks.hair is None
    loose = scenes.hair(rig, 5, parent=False, name="Loose")
    assert _found(rig) == (rig, loose) and _found(loose)[1] == loose
    own = scenes.hair(rig, 5, name="Own")
    assert _found(rig) == (rig, own) and _found(skin) == (rig, own) and _found(metarig) == (metarig, loose)
    choose(other)
    own.select_set(True)  # both selected by the artist, who may want to give it this hair
    assert bpy.ops.neuralocks.find() == {"FINISHED"}
    assert (bpy.context.scene.neuralocks.armature, bpy.context.scene.neuralocks.hair) == (other, own)
    assert own.neuralocks_hair.armature == rig


def _found(selected) -> tuple:
    """What is found with an object selected, or none, for hair that is not attached to a character yet."""
    settings = bpy.context.scene.neuralocks
    settings.armature = settings.hair = None
    for thing in bpy.context.scene.objects:
        if thing.type == "CURVES":
            thing.neuralocks_hair.armature = None
    choose(selected)
    assert bpy.ops.neuralocks.find() == {"FINISHED"}
    return settings.armature, settings.hair


def without_a_window(_folder: Path) -> None:
    """Timers and scripts on a farm, which have no window, find what is selected, and convert the particle hair of the active object."""
    from dcc_addon.scene import particles

    rig, other = scenes.armature(), scenes.armature("Zoe")
    scenes.hair(rig, 5)
    choose(other)
    rig.select_set(True)
    rig.hide_set(True)
    plain, skin = scenes.body(rig), scenes.body(other)
    for thing in (plain, skin):
        thing.modifiers.new("Fur", "PARTICLE_SYSTEM")
        thing.particle_systems[0].settings.type = "HAIR"
    with bpy.context.temp_override(window=None):
        assert bpy.ops.neuralocks.find() == {"FINISHED"}
        assert bpy.context.scene.neuralocks.armature == other
        bpy.context.view_layer.objects.active = skin
        assert particles.choose(bpy.context)[0] == skin
        if bpy.app.version < (4, 0):
            raise SkipTest("this Blender converts nothing without a window")
        assert bpy.ops.neuralocks.from_particles() == {"FINISHED"}
    assert not particles.waiting(skin) and particles.waiting(plain)


def head_of_a_control_rig(_folder: Path) -> None:
    """As Rigify makes it: `head` is a control that moves no skin, and the bone that moves it copies it, below other bones. Both
    ways of naming it give the same character, and hair as on a plain rig.
    """
    plain, hair = _sampled("head")
    for chosen in ("", "DEF-spine.006", "head"):
        sampled, points = _sampled("DEF-spine.006", chosen)
        assert sampled.rig.bones[sampled.character.head] == (chosen or "DEF-spine.006")
        found = {name: sampled.rig.bones[joint] for name, joint in sampled.character.humanoid.items() if name != "head"}
        assert (found["neck"], found["upper_chest"], found["hips"]) == ("neck", "chest", "hips")
        assert sampled.character.head_width == plain.character.head_width > 0.1
        assert np.allclose(points, hair, atol=2e-5), chosen


def examined_again(_folder: Path) -> None:
    """The panel tells of the rig as it is, also after its skin was bound, after a bone got another parent and after one was moved."""
    from dcc_addon.interface.panels import findings

    rig = scenes.armature(bones=(*scenes.BONES, ("copy", "chest", (0, 0, 1.55), (0, 0, 1.75))))
    rig.data.bones["head"].use_deform = False
    assert findings(rig) == (["Head: head"], "")
    scenes.body(rig)
    assert findings(rig)[0][0].startswith("Head: copy (moves the skin")
    choose(rig)
    for parent, told in (("chest", True), ("neck", False)):
        bpy.ops.object.mode_set(mode="EDIT")
        rig.data.edit_bones["head"].parent = rig.data.edit_bones[parent]
        bpy.ops.object.mode_set(mode="OBJECT")
        assert any("No neck bone" in line for line in findings(rig)[0]) == told
    bpy.ops.object.mode_set(mode="EDIT")
    rig.data.edit_bones["copy"].translate(Vector((0, 0.5, -0.4)))
    bpy.ops.object.mode_set(mode="OBJECT")
    assert findings(rig)[0][0] == "Head: head"  # the one that moves the skin is elsewhere


def _sampled(skin_bone: str, chosen: str = ""):
    """A sampled character whose head's skin moves with this bone, with a chosen head bone, and its live hair in a frame."""
    scenes.empty()
    scene = bpy.context.scene
    rig = scenes.armature(
        bones=scenes.BONES
        + (("root", "", (0, 0, 0), (0, 0, 0.1)), ("DEF-spine.006", "root", (0, 0, 1.55), (0, 0, 1.75)))
    )
    rig.pose.bones["DEF-spine.006"].constraints.new("COPY_TRANSFORMS").target = rig
    rig.pose.bones["DEF-spine.006"].constraints[0].subtarget = "head"
    skin = scenes.body(rig)
    for bone in ("root", "DEF-spine.006"):
        skin.vertex_groups.remove(skin.vertex_groups[bone])
    skin.vertex_groups["head"].name = skin_bone
    rig.data.bones["head"].use_deform = skin_bone == "head"
    scenes.dance(rig)
    hair = scenes.hair(rig)
    rig.neuralocks_character.head_bone = chosen
    scene.neuralocks.armature, scene.neuralocks.hair = rig, hair
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    hair.neuralocks_hair.live = True
    scene.frame_set(12)
    assert not session.said.messages, session.said.messages
    return session.rigs[rig.name_full], scenes.points(hair)
