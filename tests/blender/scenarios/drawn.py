# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies that are drawn elsewhere than where hair is kept out of them."""

from pathlib import Path

import bpy

from dcc_addon.session import session
from tests.blender import scenes


def drawn_elsewhere(_folder: Path) -> None:
    """A body moved by more than its weights and shape keys gets a note on how far and by what; a plain one does not."""
    _, body = _character()
    body.shape_key_add(name="Basis")
    wide = body.shape_key_add(name="Wide")
    for point in wide.data:
        point.co.x *= 1.5
    wide.value, body.location = 0.4, (0.1, 0, 0)
    assert not _said()
    bpy.context.scene.unit_settings.scale_length = 0.01
    assert not _said()
    bpy.context.scene.unit_settings.scale_length = 1.0
    cast = body.modifiers.new("Rounder", "CAST")
    cast.factor = 0.2
    assert "modifier 'Rounder'" in _said() and " mm " in _said() and "Body" in _said()
    cast.show_viewport = False
    body.active_shape_key_index, body.show_only_shape_key = 1, True
    assert "pinned" in _said()
    body.show_only_shape_key = False
    assert not _said()
    some = body.vertex_groups.new(name="some")
    some.add([v.index for v in body.data.vertices], 0.3, "REPLACE")
    body.modifiers[0].vertex_group = "some"
    assert f"Vertex Group of '{body.modifiers[0].name}'" in _said()


def drawn_elsewhere_below_more(_folder: Path) -> None:
    """What moves a body is told below a subdivision, too, and for bones of several segments; not if other vertices are drawn."""
    rig, body = _character()
    subdivision = body.modifiers.new("Finer", "SUBSURF")
    subdivision.subdivision_type, subdivision.levels = "SIMPLE", 1
    assert not _said()
    puff = body.modifiers.new("Puff", "DISPLACE")
    puff.strength = 0.02
    assert "modifier 'Puff'" in _said()
    body.modifiers.new("Thick", "SOLIDIFY")
    assert not _said()
    body.modifiers.clear()
    body.modifiers.new("Armature", "ARMATURE").object = rig
    assert not _said()
    rig.data.bones["head"].bbone_segments = 8
    rig.pose.bones["head"].bbone_curveinx = 0.3
    assert "Segments above 1 of the bendy bone 'head'" in _said()


def head_of_its_own(_folder: Path) -> None:
    """A head that rides on its bone as a whole is named, since it is not part of the body, until it is; glasses, and what renders do not
    draw, are not.
    """
    rig, body = _character()
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.09, location=(0, 0, 1.66))
    head = bpy.context.active_object
    bpy.ops.mesh.primitive_cube_add(size=0.1, location=(0, -0.1, 1.62))
    tail = scenes.translation((0, rig.data.bones["head"].length, 0))
    for part, name in ((head, "Skull"), (bpy.context.active_object, "Glasses")):
        part.name, part.parent, part.parent_type, part.parent_bone = name, rig, "BONE", "head"
        part.matrix_parent_inverse = (rig.data.bones["head"].matrix_local @ tail).inverted()
    assert "Skull: it rides on the bone 'head'" in _said() and "Glasses" not in _said()
    head.hide_render = True
    assert not _said()
    head.hide_render = False
    rig.neuralocks_character.body = head
    assert "Skull" not in _said()
    rig.neuralocks_character.body = None
    head.vertex_groups.new(name="head").add(range(len(head.data.vertices)), 1.0, "REPLACE")
    head.parent_type = "OBJECT"
    head.matrix_parent_inverse.identity()
    head.modifiers.new("Armature", "ARMATURE").object = rig
    assert not _said()


def _character():
    """An armature that moves, with hair, and its body."""
    scene, rig = bpy.context.scene, scenes.armature()
    scenes.dance(rig)
    body, strands = scenes.body(rig), scenes.hair(rig, 4)
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    return rig, body


def _said() -> str:
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    return " ".join(session.rigs["Rig"].bodies_off)
