# SPDX-License-Identifier: GPL-3.0-or-later
"""Which bodies the panel takes a character to have: it looks again only after an edit that may change them, and after each of these."""

from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import choose, make_live, needs_usd
from tests.blender.panel import drawn


def looked_for_again(_folder: Path) -> None:
    """After any edit, what is known of bodies is what a look at all objects finds; each of these edits changes it."""
    edits = (
        *(_hidden, _group_hidden, _excluded, _unlinked, _deleted, _layer_unused, _second),
        *(_undeformed, _deformed_by_none, _parented, _emptied, _swapped, _chosen),
        *(_sculpted, _weighed, _levelled, _raised, _muted, _sculpted_shape, _driver_removed, _driver_silenced),
        *(_keyed, _keys_replaced, _strip_added, _drawn_by_keys, _drawn_by_no_keys, _drawn_by_no_driver),
    )
    for edit in edits:
        rig, skin = _character()
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
    rig, skin = _character()
    prop = bpy.data.objects.new("Prop", bpy.data.meshes.new("Prop"))
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    for thing in (prop, lamp):
        bpy.context.scene.collection.objects.link(thing)
    make_live(rig, bpy.data.objects["Hair"])
    before = _known(rig)
    with (
        patch("dcc_addon.scene.body_known.bodies_of") as look,
        patch("dcc_addon.scene.body_known._surface") as read,
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


def driven_since(folder: Path) -> None:
    """If a driver of a body's shape keys is edited after hair was attached, a note says so until it is as before, also when the file is
    opened again; new names are no edit.
    """
    needs_usd()
    rig, skin = _character()
    make_live(rig, bpy.data.objects["Hair"])
    scene = bpy.context.scene
    scene.neuralocks.output = str(folder / "hair.usdc")
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"} and not _told()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    rig, skin = bpy.data.objects["Rig"], bpy.data.objects["Body"]
    (curve,) = skin.data.shape_keys.animation_data.drivers
    variable = curve.driver.variables[0]
    target = variable.targets[0]
    for owner, name, other in (
        (curve.driver, "expression", "2 * var"),
        (target, "bone_target", "head"),
        (target, "transform_type", "ROT_Z"),
        (curve, "mute", True),
    ):
        before = getattr(owner, name)
        for value in (other, before):
            setattr(owner, name, value)
            # A key that nothing drives any longer is part of the body's shape.
            parts = [] if value == before else ["body"] * (name == "mute") + ["drivers of the body"]
            assert _told() == parts, (name, _told())
    rig.name = rig.data.name = skin.name = skin.data.name = "Another"
    skin.data.shape_keys.key_blocks["Driven"].name = "Frown"
    rig.data.bones["neck"].name = "Throat"
    assert not _told(), _told()
    curve.driver.expression = "0.5 * var"
    bpy.context.view_layer.update()
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    assert _told() == ["drivers of the body"]
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"} and not _told()


def drivers_told(_folder: Path) -> None:
    """Each edit of a driver changes the number of drivers."""
    from dcc_addon.scene.driven import number_of_drivers

    rig, skin = _character()
    curve = skin.data.shape_keys.animation_data.drivers[0]
    limits = curve.modifiers.new("LIMITS")
    variable = curve.driver.variables[0]
    variable.type, target = "SINGLE_PROP", variable.targets[0]
    target.id, target.data_path = rig, 'pose.bones["neck"].rotation_euler[0]'
    seen = [number_of_drivers(skin.data)]
    for edit in (
        lambda: setattr(target, "data_path", 'pose.bones["head"].rotation_euler[0]'),
        lambda: setattr(target, "data_path", 'pose.bones["head"].rotation_euler[1]'),
        lambda: setattr(curve.driver, "use_self", True),
        lambda: setattr(limits, "max_y", 2.0),
        lambda: curve.keyframe_points.insert(1.0, 2.0),
        lambda: setattr(curve, "data_path", 'key_blocks["Held"].value'),
    ):
        edit()
        found = number_of_drivers(skin.data)
        assert found not in seen, len(seen)
        seen.append(found)


def _character() -> tuple:
    """A dancing rig with hair and a body with shape keys: held, keyed and driven by the neck."""
    scenes.empty()
    rig, _ = scenes.dancer(10, skinned=True)
    skin = bpy.data.objects["Body"]
    skin.shape_key_add(name="Basis")
    for name in ("Held", "Keyed", "Driven"):
        block = skin.shape_key_add(name=name)
        for point in block.data:
            point.co.x *= 1.2
    blocks = skin.data.shape_keys.key_blocks
    blocks["Held"].value = 0.5
    for frame in (1, 24):
        blocks["Keyed"].value = frame / 24
        blocks["Keyed"].keyframe_insert("value", frame=frame)
    driver = blocks["Driven"].driver_add("value").driver
    variable, driver.expression = driver.variables.new(), "var"
    variable.type, target = "TRANSFORMS", variable.targets[0]
    target.id, target.bone_target, target.transform_type = rig, "neck", "ROT_X"
    return rig, skin


def _known(rig):
    from dcc_addon.scene.body_known import numbers_of_bodies

    bpy.context.view_layer.update()
    return numbers_of_bodies(rig, bpy.context.scene)


def _fresh(rig):
    from dcc_addon.session import session

    session.bodies.clear()
    session.surfaces.clear()
    return _known(rig)


def _told() -> list[str]:
    """The parts that the panel says were changed since the hair was attached."""
    bpy.context.view_layer.update()
    said = " ".join(drawn())
    return said.split("shows it as it was: ")[1].split("; ")[0].split(", ") if "as it was" in said else []


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
