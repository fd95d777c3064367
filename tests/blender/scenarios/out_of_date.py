# SPDX-License-Identifier: GPL-3.0-or-later
"""Which values and keys make a sampled motion out of date: those that move the rig, or may move it, and no others."""

from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import apart, make_live, points_at


def held_otherwise(_folder: Path) -> None:
    """Unkeyed values count in all frames: a change that only affects the past is noticed by a render; a moved body is noticed in
    the next frame.
    """
    from dcc_addon import handlers
    from dcc_addon.scene.motion.up_to_date import notice
    from dcc_addon.session import session

    rig, scene = scenes.armature(), bpy.context.scene
    skin = scenes.body(rig)
    scenes.dance(rig)
    strands, control = scenes.hair(rig, 20), bpy.data.objects.new("Control", None)
    scene.collection.objects.link(control)
    rig.data["swing"] = scene["swing"] = 0.0
    rig.pose.bones["head"]["swings"] = [0.0, 0.0]
    read = [
        (control, "OBJECT", "location[0]"),
        (rig.data, "ARMATURE", '["swing"]'),
        (scene, "SCENE", '["swing"]'),
        (rig, "OBJECT", 'pose.bones["head"]["swings"][1]'),
        (rig, "OBJECT", 'pose.bones["forearm.L"].location[0]'),
    ]
    driver = rig.pose.bones["neck"].driver_add("rotation_euler", 0).driver
    for number, (owner, kind, path) in enumerate(read):
        variable = driver.variables.new()
        variable.name, target = f"v{number}", variable.targets[0]
        target.id_type, target.id, target.data_path = kind, owner, path
    if bpy.app.version >= (4, 0):
        variable, scene["shown"] = driver.variables.new(), 0.0
        variable.name, variable.type, target = "v5", "CONTEXT_PROP", variable.targets[0]
        target.context_property, target.data_path = "ACTIVE_SCENE", '["shown"]'
        read.append((scene, "ACTIVE_SCENE", '["shown"]'))
    driver.expression = f"({' + '.join(v.name for v in driver.variables)}) * sin(frame) if 12 < frame < 17 else 0"
    counted = driver.variables.new()
    counted.name, counted.targets[0].id_type = "shown", "SCENE"
    counted.targets[0].id, counted.targets[0].data_path = scene, "frame_current"
    make_live(rig, strands)
    seen = points_at(strands, 20)
    notice(rig, scene)
    assert not session.rigs["Rig"].stale, "which frame it is, is no edit"

    def edit(number: int) -> None:
        if number == 0:
            control.location[0] = 1.0
        elif number == 3:
            rig.pose.bones["head"]["swings"] = [0.0, 1.0]
        elif number == 4:
            rig.pose.bones["forearm.L"].location[0] = 1.0
        else:
            read[number][0]["shown" if number == 5 else "swing"] = 1.0
        read[number][0].update_tag()

    for number in range(len(read)):
        edit(number)
        bpy.context.view_layer.update()
        if number == 5:  # a render finds it by the pose that it shows; Blender while it is idle does not
            notice(rig, scene)
            assert session.rigs["Rig"].stale
        handlers.before_render(scene)
        handlers.after_render()
        now = scenes.points(strands)
        assert apart(now, seen) > 1e-3, read[number]
        bpy.ops.neuralocks.sample_motion()
        seen = points_at(strands, 20)
        assert apart(now, seen) < 1e-6, read[number]

    sampled = session.rigs["Rig"]
    handlers.before_render(scene)
    handlers.after_render()
    assert session.rigs["Rig"] is sampled, "nothing was changed"
    skin.location.x += 0.05
    points_at(strands, 21)
    assert session.rigs["Rig"].stale


def read_by_number(_folder: Path) -> None:
    """Drivers that read one number of a keyed channel, keyed lists, and shape keys that correct a pose do not make the motion out of
    date in each other frame or pose; edits of such shapes do.
    """
    from dcc_addon.scene.motion.up_to_date import notice
    from dcc_addon.session import session

    rig, scene = scenes.armature(), bpy.context.scene
    skin = scenes.body(rig)
    scenes.dance(rig)
    skin.shape_key_add(name="Basis")
    correction = skin.shape_key_add(name="Bent")
    for point in correction.data:
        point.co = 1.01 * point.co
    for bone, path in (("neck", 'pose.bones["upper_arm.L"].rotation_euler[2]'), ("chest", "location.x")):
        driver = rig.pose.bones[bone].driver_add("rotation_euler", 0).driver
        driver.expression, variable = "0.3 * v", driver.variables.new()
        variable.name, variable.targets[0].id, variable.targets[0].data_path = "v", rig, path
    driver = correction.driver_add("value").driver
    driver.expression, variable = "abs(v)", driver.variables.new()
    variable.name, variable.type, target = "v", "TRANSFORMS", variable.targets[0]
    target.id, target.bone_target, target.transform_type = rig, "upper_arm.L", "ROT_Z"
    for frame in (1, 12):
        rig.pose.bones["spine"]["swings"] = [0.1 * frame, 1.0]
        rig.keyframe_insert('pose.bones["spine"]["swings"]', frame=frame)
    make_live(rig, scenes.hair(rig, 20))
    for frame in (1, 5, 10):
        scene.frame_set(frame)
        rig.pose.bones["head"].rotation_euler[0] += 0.1
        bpy.context.view_layer.update()
        notice(rig, scene)
        assert not session.rigs["Rig"].stale, frame
    skin.data.vertices[0].co.x += 0.01
    skin.data.update()
    rig.update_tag()  # as where meshes are joined
    bpy.context.view_layer.update()
    assert session.rigs["Rig"].stale
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    driver = correction.driver_add("slider_max").driver  # which reads its own mesh
    driver.expression, variable = "v", driver.variables.new()
    variable.name, variable.targets[0].id, variable.targets[0].data_path = "v", skin, '["Fat"]'
    skin["Fat"] = 1.0
    bpy.context.view_layer.update()
    session.rigs["Rig"].stale = False
    skin.data.vertices[0].co.x += 0.01
    skin.data.update()
    bpy.context.view_layer.update()
    assert session.rigs["Rig"].stale
    rig.pose.bones["chest"]["sways"] = [0.0, 0.0]
    for frame in (1, 20):
        rig.pose.bones["chest"]["sways"][1] = 0.1 * frame
        rig.keyframe_insert('pose.bones["chest"]["sways"]', index=1, frame=frame)
    driver = rig.pose.bones["chest"].driver_add("rotation_euler", 2).driver
    driver.expression, variable = "v", driver.variables.new()
    variable.name, variable.targets[0].id = "v", rig
    variable.targets[0].data_path = 'pose.bones["chest"]["sways"][0]'
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    for turned in (False, True):
        rig.pose.bones["chest"]["sways"][0] = 0.5 * turned
        notice(rig, scene)
        assert session.rigs["Rig"].stale == turned, "the number beside is keyed, and this one is not"


def keyed_elsewhere(_folder: Path) -> None:
    """Keys of a camera, a lamp or another character leave a motion as it is; those of what moves it, or may move it, do not."""
    from dcc_addon import background
    from dcc_addon.session import session

    scene, rigs = bpy.context.scene, [scenes.armature(), scenes.armature()]
    for rig in rigs:
        scenes.dance(rig)
        make_live(rig, scenes.hair(rig, 20))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Lens"))
    empty = bpy.data.objects.new("Empty", None)
    for thing in (camera, empty):
        scene.collection.objects.link(thing)

    def told(owner, path: str, value: float = 1.0) -> list[bool]:
        for rig in rigs:
            session.rigs[rig.name].stale = False
        for frame in (3, 9):
            setattr(owner, path, (value * frame, 0.0, 0.0) if path == "location" else value * frame)
            owner.keyframe_insert(path, frame=frame)
        bpy.context.view_layer.update()
        return [session.rigs[rig.name].stale for rig in rigs]

    neither, both = [False, False], [True, True]
    assert told(camera, "location") == neither
    sampled = session.rigs.pop(rigs[1].name)
    with patch.object(background, "request") as asked:
        camera.keyframe_insert("location", frame=20)
        bpy.context.view_layer.update()
    assert asked.called, "a motion that is missing is wanted, whatever was keyed"
    session.rigs[rigs[1].name] = sampled
    assert told(rigs[0], "location") == [True, False] and told(rigs[1], "location") == [False, True]
    assert told(empty, "location") == both, "what node groups name is not known"
    rigs[0].constraints.new("OBJECT_SOLVER").camera = camera
    for rig in rigs:
        scene.neuralocks.armature = rig
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert told(camera, "location", 2.0) == [True, False]
    assert told(camera.data, "lens") == both, "what else reads a lens is not known"


def group_renamed(_folder: Path) -> None:
    """A body whose vertex group has another name follows another bone, or none: its motion is out of date, until it has its name back."""
    from dcc_addon.scene.motion.up_to_date import known

    rig, strands = scenes.dancer(10, skinned=True)
    make_live(rig, strands)
    scene, group = bpy.context.scene, bpy.data.objects["Body"].vertex_groups["head"]
    sampled = known(rig, scene)
    group.name = "nothing"
    assert sampled is not None and known(rig, scene) is None
    group.name = "head"
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"} and known(rig, scene) is not None
