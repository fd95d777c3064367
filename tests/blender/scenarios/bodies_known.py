# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bodies the panel takes a character to have: it looks again only after an edit that may change them, and after each of these."""

from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import choose, make_live


def looked_for_again(_folder: Path) -> None:
    """After any edit, what is known of bodies is what a look at all objects finds; each of these edits changes it."""
    edits = (
        *(_hidden, _group_hidden, _excluded, _unlinked, _deleted, _layer_unused, _second),
        *(_undeformed, _deformed_by_none, _parented, _emptied, _swapped, _chosen),
        *(_sculpted, _weighed, _levelled, _raised, _muted, _sculpted_shape, _driver_removed, _driver_silenced),
        *(_keyed, _keys_replaced, _strip_added, _drawn_by_keys, _drawn_by_no_keys, _drawn_by_no_driver),
    )
    for edit in edits:
        rig, skin = scenes.dancer_with_shapes()
        if edit in (_drawn_by_no_keys, _drawn_by_no_driver):
            (_keys_drawing if edit is _drawn_by_no_keys else _driver_drawing)(skin)
        before = _known(rig)
        edit(rig, skin)
        found = _known(rig)
        assert found == _fresh(rig), edit
        assert found != before, edit


def not_looked_for_again(_folder: Path) -> None:
    """A pose, also one that drives shape keys, and whatever else an artist moves, is no reason to look; with driven keys, neither to read
    the body.
    """
    rig, skin = scenes.dancer_with_shapes()
    prop = bpy.data.objects.new("Prop", bpy.data.meshes.new("Prop"))
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    for thing in (prop, lamp):
        bpy.context.scene.collection.objects.link(thing)
    make_live(rig, bpy.data.objects["Hair"])
    before = _known(rig)
    with (
        patch("dcc_addon.scene.baked.body_record.bodies_of") as look,
        patch("dcc_addon.scene.baked.body_record._surface") as read,
    ):
        for move in (
            lambda: setattr(prop, "location", (1, 2, 3)),
            lambda: setattr(lamp, "location", (1, 2, 3)),
            lambda: setattr(lamp.data, "energy", 7.0),
            lambda: setattr(rig, "location", (1, 2, 3)),
            lambda: setattr(skin, "location", (0, 0, 0.01)),
            lambda: setattr(rig.pose.bones["neck"], "rotation_euler", (0.3, 0, 0)),
            lambda: setattr(bpy.data.objects["Hair"].neuralocks_hair, "motion", 0.5),
            lambda: bpy.context.scene.frame_set(9),
        ):
            move()
            assert _known(rig) == before and not look.called and not read.called
    assert _fresh(rig) == before


def _known(rig):
    from dcc_addon.scene.baked.body_record import numbers_of_bodies

    bpy.context.view_layer.update()
    return numbers_of_bodies(rig, bpy.context.scene)


def _fresh(rig):
    from dcc_addon.session import session

    session.read.bodies.clear()
    session.read.surfaces.clear()
    return _known(rig)


def _hidden(_rig, skin) -> None:
    skin.hide_render = True


def _group_hidden(_rig, skin) -> None:
    _into_a_collection(skin).hide_render = True


def _excluded(_rig, skin) -> None:
    _into_a_collection(skin)
    bpy.context.view_layer.layer_collection.children["Own"].exclude = True


def _into_a_collection(skin):
    own, top = bpy.data.collections.new("Own"), bpy.context.scene.collection
    top.children.link(own)
    own.objects.link(skin)
    top.objects.unlink(skin)
    bpy.context.view_layer.update()
    return own


def _unlinked(_rig, skin) -> None:
    bpy.context.scene.collection.objects.unlink(skin)


def _deleted(_rig, skin) -> None:
    bpy.data.objects.remove(skin)


def _layer_unused(_rig, skin) -> None:
    own, scene = _into_a_collection(skin), bpy.context.scene
    other = scene.view_layers.new("Other")
    other.layer_collection.children[own.name].exclude = True
    bpy.context.view_layer.update()
    scene.view_layers[0].use = False


def _second(_rig, skin) -> None:
    bpy.context.scene.collection.objects.link(skin.copy())


def _undeformed(_rig, skin) -> None:
    skin.modifiers.clear()


def _deformed_by_none(_rig, skin) -> None:
    skin.modifiers["Armature"].object = None


def _parented(rig, skin) -> None:
    other = bpy.data.objects.new("Shirt", skin.data.copy())
    bpy.context.scene.collection.objects.link(other)
    other.parent = rig
    bpy.context.view_layer.update()
    other.parent_type = "ARMATURE"


def _emptied(_rig, skin) -> None:
    skin.shape_key_clear()
    skin.data.clear_geometry()


def _swapped(_rig, skin) -> None:
    skin.data = skin.data.copy()
    skin.data.shape_keys.reference_key.data[0].co.x += 1.0


def _chosen(rig, _skin) -> None:
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.view_layer.update()
    rig.neuralocks_character.body = bpy.context.object


def _sculpted(_rig, skin) -> None:
    skin.data.shape_keys.reference_key.data[0].co.x += 1.0


def _weighed(_rig, skin) -> None:
    skin.vertex_groups["head"].add(range(len(skin.data.vertices)), 0.5, "REPLACE")


def _levelled(_rig, skin) -> None:
    choose(skin)
    bpy.ops.object.vertex_group_levels(group_select_mode="ALL", offset=-0.25)


def _raised(_rig, skin) -> None:
    skin.data.shape_keys.key_blocks["Held"].value = 0.75


def _muted(_rig, skin) -> None:
    skin.data.shape_keys.key_blocks["Held"].mute = True


def _sculpted_shape(_rig, skin) -> None:
    skin.data.shape_keys.key_blocks["Held"].data[0].co.x += 1.0


def _driver_removed(_rig, skin) -> None:
    skin.data.shape_keys.key_blocks["Driven"].driver_remove("value")


def _driver_silenced(_rig, skin) -> None:
    skin.data.shape_keys.animation_data.drivers[0].mute = True


def _keyed(_rig, skin) -> None:
    skin.data.shape_keys.key_blocks["Keyed"].keyframe_insert("value", frame=12)


def _keys_replaced(_rig, skin) -> None:
    skin.data.shape_keys.animation_data.action = None


def _strip_added(_rig, skin) -> None:
    data = skin.data.shape_keys.animation_data
    other = data.action.copy()
    for point in scenes.fcurves_of(other)[0].keyframe_points:
        point.co.y *= 2
    data.nla_tracks.new().strips.new("Other", 1, other)
    bpy.context.view_layer.update()


def _drawn_by_keys(_rig, skin) -> None:
    _keys_drawing(skin)
    skin.hide_render = True
    bpy.context.view_layer.update()
    skin.animation_data_clear()


def _drawn_by_no_keys(_rig, skin) -> None:
    scenes.fcurves(skin)[0].mute = True


def _drawn_by_no_driver(_rig, skin) -> None:
    skin.animation_data.drivers[0].mute = True


def _keys_drawing(skin) -> None:
    skin.keyframe_insert("hide_render", frame=3)
    skin.hide_render = True


def _driver_drawing(skin) -> None:
    skin.driver_add("hide_render").driver.expression = "1"
    skin.hide_render = True
