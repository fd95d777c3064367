# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of bodies that Blender reports elsewhere, or not at all, since no view in which the hair is live evaluates them."""

from pathlib import Path

import bpy

from tests.blender import scenes
from tests.blender.checks import choose, make_live


def edited_in_another_scene(_folder: Path) -> None:
    """Hair is live in one scene, and its body is keyed, sculpted or weighted in another: when the first is shown again, or rendered,
    its motion is out of date. Other meshes that are edited there change nothing.
    """
    from dcc_addon.scene.motion.up_to_date import known

    for edit in (_key_raised, _sculpt_all, _weigh_anew, None):
        scenes.empty()
        rig, skin, scene = _raised_head()
        other = bpy.data.scenes.new("Animation")
        for thing in (rig, skin):
            other.collection.objects.link(thing)
        bpy.context.window.scene = other
        own = scenes.body(rig)
        rig.select_set(False)
        own.modifiers.clear()
        bpy.context.view_layer.update()
        (edit or _sculpt_all)(skin if edit else own)
        bpy.context.view_layer.update()
        bpy.context.window.scene = scene
        assert (known(rig, scene) is None) == (edit is not None), edit


def body_out_of_view(_folder: Path) -> None:
    """A body that only renders draw, beside one that is shown in its place, is edited where Blender tells nothing of it; and the
    camera icon of a modifier is not told of any body. Hiding the body, also in another view layer, changes nothing.
    """
    from dcc_addon.scene.motion.up_to_date import known

    for hide in (_disable, _exclude, None):
        for edit in (_key_raised, _sculpt_all, _weigh_anew, _mirror_off) if hide else (_mirror_off,):
            scenes.empty()
            rig, skin, scene = _raised_head(hide)
            assert known(rig, scene) is not None
            scene.frame_set(8)
            assert known(rig, scene) is not None, "another frame is no edit"
            if not hide:
                _disable(skin)
                scene.view_layers.new("Other").layer_collection.exclude = True
                assert known(rig, scene) is not None, "hiding is no edit"
                skin.hide_viewport = False
            edit(skin)
            bpy.context.view_layer.update()
            assert known(rig, scene) is None, (hide, edit)


def _raised_head(hide=None) -> tuple:
    """A dancing character with live hair, a keyed shape and a mirror modifier that is off."""
    rig, strands = scenes.dancer(10, skinned=True)
    (skin,) = (thing for thing in bpy.data.objects if thing.type == "MESH")
    skin.shape_key_add(name="Basis")
    raised = skin.shape_key_add(name="raised")
    for point in raised.data:
        point.co.z += 0.04
    for frame in (1, 24):
        raised.keyframe_insert("value", frame=frame)
    mirror = skin.modifiers.new("Mirror", "MIRROR")
    mirror.show_viewport = mirror.show_render = False
    choose(skin)
    bpy.ops.object.modifier_move_to_index(modifier="Mirror", index=0)
    if hide:
        hide(skin)
    make_live(rig, strands, resolve=True)
    return rig, skin, bpy.context.scene


def _disable(skin) -> None:
    skin.hide_viewport = True


def _exclude(skin) -> None:
    own = bpy.data.collections.new("Renders")
    bpy.context.scene.collection.children.link(own)
    for collection in skin.users_collection:
        collection.objects.unlink(skin)
    own.objects.link(skin)
    bpy.context.scene.view_layers.new("All")
    bpy.context.view_layer.layer_collection.children["Renders"].exclude = True


def _key_raised(skin) -> None:
    raised = skin.data.shape_keys.key_blocks["raised"]
    raised.value = 1.0
    raised.keyframe_insert("value", frame=12)


def _sculpt_all(skin) -> None:
    skin.shape_key_clear()
    for vertex in skin.data.vertices:
        vertex.co.x *= 1.5
    skin.data.update()


def _weigh_anew(skin) -> None:
    group = next(each for each in skin.vertex_groups if each.name == "head")
    group.add([vertex.index for vertex in skin.data.vertices], 0.5, "REPLACE")
    skin.data.update()


def _mirror_off(skin) -> None:
    skin.modifiers["Mirror"].show_render = True
