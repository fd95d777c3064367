# SPDX-License-Identifier: GPL-3.0-or-later
"""The character and the hair that belong together, among others in the scene."""

from pathlib import Path

import bpy

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
