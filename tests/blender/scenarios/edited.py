# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of which Blender tells little: of what moves a rig, besides keys, and of live hair itself."""

import math
import shutil
from pathlib import Path

import bpy
import numpy as np

from dcc_addon.scene.nodes import geometry_nodes
from neuralocks_core.model import shipped
from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, baked_points, choose, make_live, messages, points_at, refused


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

    class Witness(bpy.types.RenderEngine):
        bl_idname, bl_label = "WITNESS", "Witness"

        def render(self, graph):
            got.append(scenes.points(strands, graph))

    bpy.utils.register_class(Witness)
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "WITNESS", 8, 8

    edits = [(strip, "mute", True), (curve.driver, "expression", "0"), (constraint, "influence", 0.1)]
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
    bpy.utils.unregister_class(Witness)
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


def other_strands(folder: Path) -> None:
    """Live hair that is given other curves, or more or fewer strands, is that hair at once, and the curves that it had get
    their rest shape back; live goes on when an editing mode is left.
    """
    from dcc_addon.operators.bake import bake_steps
    from dcc_addon.scene import curves

    rig = scenes.armature()
    scenes.dance(rig)
    strands, other = scenes.hair(rig, 20), scenes.hair(rig, 20, length=0.15, name="Other")
    short, long = other.data, strands.data
    bpy.data.objects.remove(other)
    groomed = curves.points(long)
    make_live(rig, strands)
    shown = points_at(strands, 9)

    bpy.context.view_layer.objects.active = strands
    long.surface = scenes.body(rig)
    for mode in ("EDIT_CURVES" if bpy.app.version < (3, 5) else "EDIT", "SCULPT_CURVES"):
        if bpy.app.version < (3, 5) and mode == "EDIT_CURVES":
            continue  # no such mode yet
        bpy.ops.object.mode_set(mode=mode)
        bpy.context.view_layer.update()
        assert np.array_equal(curves.shown(long), groomed)
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.context.view_layer.update()
        assert apart(scenes.points(strands), shown) < 1e-6 or len(long.points) != len(groomed), mode

    strands.data = short
    bpy.context.view_layer.update()
    assert np.array_equal(curves.shown(long), groomed) and not curves.has_rest(long)
    if hasattr(short, "add_curves"):
        points_at(strands, 5)
        short.add_curves([24])
        end = np.float32([[0, 0.05, 1.7 - 0.01 * k] for k in range(24)])
        for name in ("position", curves.REST):
            values = np.concatenate([curves.points(short)[:-24], end])
            short.attributes[name].data.foreach_set("vector", values.ravel())
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    view = {frame: points_at(strands, frame) for frame in (4, 9)}
    for _ in (steps := _Returned(bake_steps(bpy.context, rig, [strands], str(folder / "out.usdc")))):
        pass
    for frame, seen in view.items():
        assert apart(seen, baked_points(*steps.value["Hair"], frame)) < 1e-5, frame
    assert not messages(), messages()

    bpy.context.scene.collection.objects.unlink(strands)
    strands.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "left.blend"))
    assert not curves.has_rest(short), "hair that is in no scene is saved at rest"


def replaced_model(folder: Path) -> None:
    """A model file that is written anew, by another training say, is what live hair is moved by from the next frame on, as
    a bake would be.
    """
    rig = scenes.armature()
    scenes.dance(rig)
    strands, model = scenes.hair(rig, 20), folder / "mine.neuralocks"
    shutil.copy(MODEL, model)
    make_live(rig, strands)
    strands.neuralocks_hair.model = str(model)
    before = points_at(strands, 9)
    new = folder / "new.neuralocks"
    shutil.copy(shipped("strands"), new)
    new.replace(model)
    after = points_at(strands, 9)
    strands.neuralocks_hair.model = ""
    assert apart(before, after) > 0.005 and apart(after, points_at(strands, 9)) == 0.0
    strands.neuralocks_hair.model = str(model)
    model.unlink()
    points_at(strands, 9)
    assert "mine.neuralocks" in messages()["Hair"], messages()


def applied(_folder: Path) -> None:
    """What is applied to the points of live hair is applied to its rest shape: as it would be with Live off, and nothing
    moves meanwhile. What cannot be is told, and Live is off then.
    """

    def groomed(live: bool, change):
        """Rest points after `change`, in the world, and by how much live hair moved meanwhile."""
        scenes.empty()
        rig = scenes.armature()
        scenes.dance(rig)
        strands, scene = scenes.hair(rig, 20), bpy.context.scene
        strands.rotation_euler, strands.scale = (0.1, 0.3, 0.5), (1.4, 1.4, 1.4)
        before = points_at(strands, 9)
        if live:
            make_live(rig, strands)
            before = points_at(strands, 9)
        choose(strands)
        change(strands)
        bpy.context.view_layer.update()
        moved = apart(points_at(strands, 9), before) if len(strands.data.points) * 3 == before.size else None
        if live:
            assert strands.neuralocks_hair.live, messages()
            strands.neuralocks_hair.live = False
        scene.frame_set(1)
        return scenes.points(strands), moved

    def more(strands):
        scenes.hair(strands.parent, 10, name="More", length=0.1).select_set(True)
        bpy.ops.object.join()

    changes = [
        lambda _: bpy.ops.object.transform_apply(location=True, rotation=True, scale=True),
        lambda _: bpy.ops.object.origin_set(type="ORIGIN_GEOMETRY"),
    ]
    if bpy.app.version >= (5, 2):
        changes.append(more)
    for change in changes:
        off, _ = groomed(False, change)
        live, moved = groomed(True, change)
        assert apart(off, live) < 1e-6
        assert change is more or moved < 1e-5

    scenes.empty()
    rig = scenes.armature()
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    groom = np.array([point.position for point in strands.data.points])
    tree, source, target = geometry_nodes("Frizz")
    offset = tree.nodes.new("GeometryNodeSetPosition")
    offset.inputs["Offset"].default_value = (0, 0.05, 0)
    tree.links.new(source, offset.inputs[0])
    tree.links.new(offset.outputs[0], target)
    strands.modifiers.new("Frizz", "NODES").node_group = tree
    make_live(rig, strands)
    points_at(strands, 9)
    choose(strands)
    bpy.ops.object.modifier_apply(modifier="Frizz")
    points_at(strands, 10)
    assert "'Frizz' was applied" in messages()["Hair"] and not strands.neuralocks_hair.live
    assert np.array_equal([point.position for point in strands.data.points], groom)


def held_otherwise(_folder: Path) -> None:
    """What is not keyed counts in all frames: where it changes in the past alone, a render knows; a body that is put
    elsewhere is noticed in the next frame.
    """
    from dcc_addon import handlers
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
    driver.expression = "(v0 + v1 + v2 + v3 + v4) * sin(frame) if 12 < frame < 17 else 0"
    make_live(rig, strands)
    seen = points_at(strands, 20)

    def edit(number: int) -> None:
        if number == 0:
            control.location[0] = 1.0
        elif number == 3:
            rig.pose.bones["head"]["swings"] = [0.0, 1.0]
        elif number == 4:
            rig.pose.bones["forearm.L"].location[0] = 1.0
        else:
            read[number][0]["swing"] = 1.0
        read[number][0].update_tag()

    for number in range(len(read)):
        edit(number)
        bpy.context.view_layer.update()
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


def hidden_prop(folder: Path) -> None:
    """A prop that is hidden by a scale of zero does not keep anybody from baking; of a bone that moves hair it is told."""
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


class _Returned:
    """A generator to loop over; `value` is what it returned."""

    def __init__(self, steps):
        self._steps, self.value = steps, None

    def __iter__(self):
        self.value = yield from self._steps
