# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of which Blender tells little: of what moves a rig, besides keys."""

import math
from pathlib import Path

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import apart, make_live, messages, points_at
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
