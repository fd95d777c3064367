# SPDX-License-Identifier: GPL-3.0-or-later
"""What a renderer is given, seen by an engine of our own."""

from pathlib import Path

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, messages, points_at, refused
from tests.blender.witness import ENGINE, film, witness


def rendered(folder: Path) -> None:
    """An animation is rendered as it is shown, with live strands and live hair bones, keyed ones too: every bone of the
    rig and every point of the hair.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.body(rig)
    scenes.dance(rig)
    tail = rig.pose.bones["hair.02"]
    tail.rotation_mode = "QUATERNION"
    for frame in (1, 24):  # as with a key on the whole character
        tail.keyframe_insert("rotation_quaternion", frame=frame)
    strands, scene = scenes.hair(rig, 20), bpy.context.scene
    make_live(rig, strands)
    rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}

    def seen(graph):
        evaluated = rig.evaluated_get(graph)
        bones = [np.array(evaluated.matrix_world) @ np.array(bone.matrix) for bone in evaluated.pose.bones]
        return np.array(bones), scenes.points(strands, graph)

    def shown(frame):
        scene.frame_set(frame)
        return seen(bpy.context.evaluated_depsgraph_get())

    still = shown(5)
    rig.neuralocks_character.rig_live = True
    view = {frame: shown(frame) for frame in (5, 6, 7)}
    tips = [bone.name == "hair.02" for bone in rig.pose.bones]
    assert apart(still[0][tips], view[5][0][tips]) > 0.01 and not messages(), messages()

    got = {}

    def look(_engine, graph):
        got[graph.scene.frame_current] = seen(graph)

    film(scene)
    scene.render.filepath = str(folder / "r_")
    scene.neuralocks.frame_start, scene.neuralocks.frame_end = 1, 24
    scene.neuralocks.use_scene_range = False  # the frames before the render are remembered
    scene.frame_set(15)
    scene.frame_start, scene.frame_end = 5, 7
    with witness(look):
        scene.render.engine = ENGINE
        bpy.ops.render.render(animation=True)
    assert sorted(got) == sorted(view)
    for frame, (bones, points) in view.items():
        assert apart(got[frame][0], bones) < 1e-6, frame
        assert apart(got[frame][1], points) < 1e-6, frame


def view_layers(folder: Path) -> None:
    """A character that one of two view layers excludes: whichever is in view, it is drawn, baked and rendered the same, also by a
    farm and through another scene; if both exclude it, a message says so.
    """
    from dcc_addon.scene.character.layers import graph_of
    from dcc_addon.session import session

    rig, scene = scenes.armature(), bpy.context.scene
    skin = scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    skin.shape_key_add(name="Basis")
    wide = skin.shape_key_add(name="Wide")
    for point in wide.data:
        point.co.x *= 1.2
    for frame in (1, 24):
        wide.value = frame / 24
        wide.keyframe_insert("value", frame=frame)
    scenes.collect("Character")
    make_live(rig, strands)
    shown = {frame: points_at(strands, frame) for frame in (7, 8, 9)}
    scene.view_layers[0].name = "Char"
    scene.view_layers.new("Env").layer_collection.children["Character"].exclude = True
    for frame, points in shown.items():
        assert apart(points_at(strands, frame), points) < 1e-6, frame

    prim, got = "/Character/Hair_Hair", {}
    for name in ("Char", "Env"):
        bpy.context.window.view_layer = scene.view_layers[name]
        scene.frame_set(5)
        assert bpy.ops.neuralocks.bake(filepath=str(folder / f"{name}.usdc")) == {"FINISHED"}
        assert np.ptp(session.rigs["Rig"].motion.shape) > 0.9, name
        for frame, points in shown.items():
            assert apart(baked_points(folder / f"{name}.usdc", prim, frame), points) < SAME, (name, frame)

    for layer in scene.view_layers:
        layer.layer_collection.children["Character"].exclude = True
    refused(bpy.ops.neuralocks.sample_motion, "hidden")
    scene.view_layers["Char"].layer_collection.children["Character"].exclude = False
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    for name in ("Char", "Env"):
        bpy.context.window.view_layer = scene.view_layers[name]
        scene.frame_set(8)
        drawn = scenes.points(strands, graph_of(scene, scene.view_layers["Char"]))
        assert apart(drawn, shown[8]) < 1e-6 and not messages(), (name, messages())

    def look(_engine, graph):
        if graph.view_layer.name == "Char":
            got[graph.scene.frame_current] = scenes.points(bpy.data.objects["Hair"], graph)

    main = bpy.data.scenes.new("Main")
    scene.neuralocks.use_scene_range, scene.neuralocks.frame_end = False, 24
    scene.frame_start, scene.frame_end = 7, 9
    with witness(look):
        for each in (scene, main):
            film(each)
            each.render.engine, each.render.filepath = ENGINE, str(folder / "r_")
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "env.blend"))
        for in_view in ("Scene", "Main"):
            bpy.ops.wm.open_mainfile(filepath=str(folder / "env.blend"))
            bpy.context.window.scene = bpy.data.scenes[in_view]
            bpy.ops.render.render(animation=True, scene="Scene")
            assert sorted(got) == sorted(shown) and not messages(), (in_view, messages())
            assert all(apart(got[frame], shown[frame]) < 1e-6 for frame in shown), in_view
            got.clear()


def motion_blur(folder: Path) -> None:
    """Renderers take live hair as deformed, so they ask for it within the shutter, and get what is shown there, also after a script
    has saved the file between two frames; nothing is left on it afterwards, nor in that file.
    """
    rig = scenes.armature()
    scenes.dance(rig)
    strands, plain, scene = scenes.hair(rig, 20), scenes.hair(rig, 20, name="Plain"), bpy.context.scene
    scene.frame_start, scene.frame_end, scene.neuralocks.subframes = 3, 4, 4
    make_live(rig, strands)
    shown = {frame: points_at(strands, int(frame), frame % 1) for frame in (3.0, 3.75, 4.0, 4.25)}
    got, deformed = {}, []

    def look(engine, graph):
        deformed.extend(hair.evaluated_get(graph).is_deform_modified(scene, "RENDER") for hair in (strands, plain))
        for frame in [each for each in shown if int(each + 0.25) == graph.scene.frame_current]:
            engine.frame_set(int(frame), subframe=frame % 1)
            got[frame] = scenes.points(strands, graph)
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "meanwhile.blend"), copy=True)

    film(scene)
    scene.render.filepath = str(folder / "picture")
    with witness(look):
        scene.render.engine = ENGINE
        bpy.ops.render.render(animation=True)
    assert deformed == [True, False] * 2
    for frame, points in shown.items():
        assert apart(got[frame], points) < 1e-6, frame
    assert not strands.modifiers and not any(tree.users for tree in bpy.data.node_groups) and not messages(), messages()
    with bpy.data.libraries.load(str(folder / "meanwhile.blend")) as (saved, _):
        assert not saved.node_groups


def own_velocities(folder: Path) -> None:
    """A groom keeps velocities that it has from a file, and no renderer blurs live or attached hair along them; they are back when
    the cache is removed.
    """
    rig, strands = scenes.dancer(20)
    scene = bpy.context.scene
    stored = np.full(3 * len(strands.data.points), 7.0, np.float32)
    strands.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", stored)
    deform = scenes.surface_deform(strands)  # with it, renderers ask for points within the shutter anyway
    got = []

    def look(engine, graph):
        got.append("velocity" in strands.evaluated_get(graph).data.attributes)

    film(scene)
    with witness(look):
        scene.render.engine = ENGINE
        bpy.ops.render.render()
        make_live(rig, strands)
        bpy.ops.render.render()
        strands.modifiers.remove(deform)
        bpy.ops.render.render()
    assert got == [True, False, False] and not messages(), messages()
    assert strands.data.attributes["velocity"].data[0].vector[0] == 7.0 and not strands.modifiers
    if not getattr(bpy.app.build_options, "usd", False):
        return
    out = str(folder / "hair.usdc")

    def velocity() -> float | None:
        scene.frame_set(9)
        data = strands.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
        found = data.attributes.get("velocity")
        return None if found is None else max(abs(each) for point in found.data for each in point.vector)

    for samples in (1, 4):
        scene.neuralocks.subframes = samples
        for bake in (bpy.ops.neuralocks.bake_attach, bpy.ops.neuralocks.bake):
            assert bake(filepath=out) == {"FINISHED"}
            assert (velocity() or 0.0) < 6.0, "it is blurred along the groom's own velocities"
            assert (velocity() is None) == (samples == 4 or bpy.app.version < (4, 5)), samples
            assert len(strands.modifiers) == 2
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
        bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
        scene, strands = bpy.context.scene, bpy.data.objects["Hair"]
        assert (velocity() is None) == (samples == 4 or bpy.app.version < (4, 5)), samples
        if samples == 4:
            strands.modifiers.remove(strands.modifiers["Neuralocks Cache"])
        assert bpy.ops.neuralocks.detach() == {"FINISHED"}
        assert velocity() == 7.0 and not strands.modifiers
