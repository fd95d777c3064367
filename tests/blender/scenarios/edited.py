# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of which Blender tells little: of what moves a rig, besides keys."""

import math
from pathlib import Path
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, messages, points_at, refused
from tests.blender.witness import ENGINE, film, witness


def rearranged(_folder: Path) -> None:
    """Strips, drivers, constraints and rest bones that only change what hair remembers, not the pose that is drawn, are
    noticed before a render and while Blender is idle.
    """
    from dcc_addon import background
    from dcc_addon.session import session

    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    strands, strip, curve, constraint = scenes.hair(rig, 20), *_moved_in_the_past(rig)
    scene.frame_set(20)
    make_live(rig, strands)
    got = []

    def look(_engine, graph):
        got.append(scenes.points(strands, graph))

    film(scene)

    edits = [(strip, "mute", True), (curve.driver, "expression", "0"), (constraint, "influence", 0.1)]
    with witness(look):
        scene.render.engine = ENGINE
        for beside, (thing, name, value) in zip((False, True, False), edits, strict=True):
            was, before = getattr(thing, name), scenes.points(strands)
            setattr(thing, name, value)
            bpy.context.view_layer.update()
            if beside:
                while background.look() is not None:
                    pass
                assert not session.rigs["Rig"].stale
                got.append(scenes.points(strands))
            else:
                bpy.ops.render.render()
            assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
            assert apart(before, scenes.points(strands)) > 0.003, (name, apart(before, scenes.points(strands)))
            assert apart(got.pop(), scenes.points(strands)) < 1e-6, name
            setattr(thing, name, was)
            assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}

        sampled = session.rigs["Rig"]
        for frame in (3, 14, 22):
            scene.frame_set(frame)
            bpy.context.view_layer.update()
            while background.look() is not None:
                pass
            assert session.rigs["Rig"] is sampled, "another frame is no edit"

        other, drawn = bpy.data.scenes.new("Other"), scenes.points(strands)
        other.frame_set(22)
        session.clear()
        bpy.context.window.scene = other
        bpy.ops.render.render(scene=scene.name)
        assert apart(got.pop(), drawn) < 1e-6, "a render of a scene that is not in view"
    assert not messages(), messages()


def _moved_in_the_past(rig) -> tuple:
    """A strip, a driver and a constraint that move the head between the frames 11 and 18 only."""
    data = rig.animation_data
    data.nla_tracks.new().strips.new("Dance", 1, data.action)
    data.action = bpy.data.actions.new("Shake")
    head = rig.pose.bones["head"]
    for frame, angle in ((1, 0.0), (3, 0.8), (5, -0.8), (6, 0.0)):
        head.rotation_euler = (0, angle, 0)
        head.keyframe_insert("rotation_euler", frame=frame)
    strip = data.nla_tracks.new().strips.new("Shake", 12, data.action)
    strip.blend_type, strip.extrapolation, data.action = "ADD", "NOTHING", None
    curve = rig.pose.bones["neck"].driver_add("rotation_euler", 0)
    curve.driver.expression = "0.8 * sin(frame) if 12 < frame < 17 else 0"
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    for frame in range(11, 19):
        target.rotation_euler.z = math.sin(frame * math.pi / 3.5 - 11 * math.pi / 3.5)
        target.keyframe_insert("rotation_euler", frame=frame)
    constraint = rig.pose.bones["spine"].constraints.new("COPY_ROTATION")
    constraint.target, constraint.mix_mode = target, "AFTER"
    return strip, curve, constraint


def unmuted_after_a_render(_folder: Path) -> None:
    """A track was muted in a render and then unmuted: hair follows the body that the next frames show, in the view and in the next
    render, although newer Blenders play such a track only after the dependencies are rebuilt.
    """
    from dcc_addon import background
    from dcc_addon.session import session

    rig, scene = scenes.armature(), bpy.context.scene
    skin = scenes.body(rig)
    scenes.dance(rig)
    data = rig.animation_data
    track = data.nla_tracks.new()
    track.strips.new("Dance", 1, data.action)
    data.action = None
    strands, drawn = scenes.hair(rig, 20), []

    def look(_engine, graph):
        drawn.append(scenes.points(strands, graph))

    film(scene)

    def shown() -> list:
        return [np.concatenate([points_at(strands, frame), _vertices(skin)]) for frame in (3, 14, 22)]

    make_live(rig, strands)
    playing = shown()
    with witness(look):
        scene.render.engine = ENGINE
        for at_once in (False, True):
            scene.frame_set(1)
            track.mute = True
            scene.frame_set(22)
            bpy.ops.render.render()
            assert apart(drawn[-1], playing[-1][: len(drawn[-1])]) > 0.1
            track.mute = False
            if at_once:
                bpy.ops.render.render()
                assert apart(drawn[-1], playing[-1][: len(drawn[-1])]) < 1e-6
            bpy.context.view_layer.update()
            while background.look() is not None:
                pass
            assert not session.rigs["Rig"].stale
            gap = max(apart(*pair) for pair in zip(shown(), playing, strict=True))
            assert gap < 1e-6, (at_once, gap)
    assert not messages(), messages()


def _vertices(skin) -> np.ndarray:
    """Points (V, 3) of a mesh in the world, as it is drawn."""
    drawn = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([drawn.matrix_world @ vertex.co for vertex in drawn.data.vertices])


def held_otherwise(_folder: Path) -> None:
    """Unkeyed values count in all frames: a change that only affects the past is noticed by a render; a moved body is noticed in
    the next frame.
    """
    from dcc_addon import handlers
    from dcc_addon.scene.up_to_date import notice
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
    from dcc_addon.scene.up_to_date import notice
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


def hidden_prop(folder: Path) -> None:
    """A prop hidden by a scale of zero does not prevent a bake; a hidden bone that moves hair gets a message."""
    prop = [*scenes.BONES, ("prop", "forearm.L", (0.5, 0, 1.2), (0.6, 0, 1.2))]
    rig, scene = scenes.armature(bones=prop), bpy.context.scene
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    bone = rig.pose.bones["prop"]
    for frame, size in ((8, (1, 1, 1)), (12, (0, 0, 0)), (16, (1, 1, 0))):
        bone.scale = size
        bone.keyframe_insert("scale", frame=frame)
    make_live(rig, strands)
    view = points_at(strands, 14)
    baked = folder / "out.usdc"
    assert bpy.ops.neuralocks.bake(filepath=str(baked)) == {"FINISHED"}
    assert apart(view, baked_points(baked, "/Character/Hair_Hair", 14)) < SAME

    head = rig.pose.bones["head"]
    for frame, size in ((5, 1), (6, 0)):
        head.scale = [size] * 3
        head.keyframe_insert("scale", frame=frame)
    scene.frame_set(3)
    refused(bpy.ops.neuralocks.sample_motion, "bone 'head'", "zero scale in frame 6")


def hidden_armature(folder: Path) -> None:
    """For a character hidden by the scale of its armature, or of a parent, the message says so, and does not blame a bone."""
    rig, strands = scenes.dancer(20, skinned=True)
    scene = bpy.context.scene
    make_live(rig, strands)
    holder = bpy.data.objects.new("Holder", None)
    scene.collection.objects.link(holder)
    rig.parent = holder
    for frame, size, said in (
        (5, 1, ""),
        (6, 0, "Rig: it has zero scale in frame 6"),
        (1, 0, "Rig: it has zero scale in frame 1"),
    ):
        holder.scale = [size] * 3
        holder.keyframe_insert("scale", frame=frame)
        if said:
            scene.frame_set(5)
            refused(bpy.ops.neuralocks.sample_motion, said)
