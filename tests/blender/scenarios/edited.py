# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of which Blender tells little: of what moves a rig, besides keys, and of live hair itself."""

import math
import shutil
from pathlib import Path

import bpy
import numpy as np

from neuralocks_core.model import shipped
from tests.blender import scenes
from tests.blender.checks import MODEL, apart, baked_points, make_live, messages, points_at


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


class _Returned:
    """A generator to loop over; `value` is what it returned."""

    def __init__(self, steps):
        self._steps, self.value = steps, None

    def __iter__(self):
        self.value = yield from self._steps
