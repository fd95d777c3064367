# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers of a body's shape keys: each edit of one is noticed, and told where hair was attached before it."""

from pathlib import Path

import bpy

from tests.blender import scenes
from tests.blender.checks import make_live, needs_usd
from tests.blender.panel import told_changed


def driven_since(folder: Path) -> None:
    """If a driver of a body's shape keys is edited after hair was attached, a note says so until it is as before, also when the file is
    opened again; new names are no edit.
    """
    needs_usd()
    rig, skin = scenes.dancer_with_shapes()
    make_live(rig, bpy.data.objects["Hair"])
    scene = bpy.context.scene
    scene.neuralocks.output = str(folder / "hair.usdc")
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"} and not told_changed()
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
            assert told_changed() == parts, (name, told_changed())
    rig.name = rig.data.name = skin.name = skin.data.name = "Another"
    skin.data.shape_keys.key_blocks["Driven"].name = "Frown"
    rig.data.bones["neck"].name = "Throat"
    assert not told_changed(), told_changed()
    curve.driver.expression = "0.5 * var"
    bpy.context.view_layer.update()
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    assert told_changed() == ["drivers of the body"]
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"} and not told_changed()


def drivers_told(_folder: Path) -> None:
    """Each edit of a driver changes the number of drivers."""
    from dcc_addon.scene.baked.shape_drivers import number_of_drivers

    rig, skin = scenes.dancer_with_shapes()
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
