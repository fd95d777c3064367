# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders in parts, and through other scenes: their compositor, or their sequencer."""

import io
from contextlib import redirect_stdout
from pathlib import Path

import bpy

from tests.blender import scenes
from tests.blender.checks import MODEL, apart, make_live, messages, points_at
from tests.blender.witness import ENGINE, film, witness


def by_parts(folder: Path) -> None:
    """A file is rendered in parts, as render farms do, and through the compositor of another scene, by a Blender that has
    just opened it: in all parts the hair is that of the whole; if hair cannot move, the console says so.
    """
    rig, strands = scenes.dancer(20)
    scene = bpy.context.scene
    make_live(rig, strands)
    shown = {frame: points_at(strands, frame) for frame in (20, 21)}
    main = bpy.data.scenes.new("Main")
    for each in (scene, main):
        film(each)
    _compose(main, scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    got = {}

    def look(_engine, graph):
        if graph.scene.name == scene_name:
            got[graph.scene.frame_current] = scenes.points(bpy.data.objects["Hair"], graph)

    scene_name = scene.name
    with witness(look):
        for name, model in ((scene_name, MODEL), ("Main", MODEL), (scene_name, "missing.neuralocks")):
            bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
            bpy.data.objects["Hair"].neuralocks_hair.model = model
            for each in bpy.data.scenes:
                each.render.engine = ENGINE
            rendered = bpy.data.scenes[name]
            rendered.frame_start, rendered.frame_end, rendered.render.filepath = 20, 21, str(folder / "r_")
            said = io.StringIO()
            with redirect_stdout(said):
                bpy.ops.render.render(animation=True, scene=name)
            assert sorted(got) == sorted(shown), name
            if model == MODEL:
                assert not messages() and "Neuralocks" not in said.getvalue(), said.getvalue()
                assert all(apart(got.pop(frame), points) < 1e-6 for frame, points in shown.items()), name
            else:
                assert "Neuralocks: " in said.getvalue() and "missing.neuralocks" in said.getvalue(), said.getvalue()


def through_strip(folder: Path) -> None:
    """An animation is rendered through the sequencer, with the strip of a scene that has live hair: the hair is as shown,
    and nothing is left on it.
    """
    rig, strands = scenes.dancer(20)
    scene = bpy.context.scene
    make_live(rig, strands)
    shown = {frame: points_at(strands, frame) for frame in (5, 6, 7)}
    got = {}

    def look(_engine, graph):
        if graph.scene.name == scene.name:
            got[graph.scene.frame_current] = scenes.points(strands, graph)

    cut = bpy.data.scenes.new("Cut")
    editor = cut.sequence_editor_create()
    (editor.strips if hasattr(editor, "strips") else editor.sequences).new_scene("Shot", scene, 1, 1)
    film(scene)
    scene.neuralocks.use_scene_range, scene.neuralocks.frame_end = False, 24
    cut.render.resolution_x = cut.render.resolution_y = 8
    cut.frame_start, cut.frame_end, cut.render.filepath = 5, 7, str(folder / "r_")
    bpy.context.window.scene = cut
    with witness(look):
        scene.render.engine = ENGINE
        bpy.ops.render.render(animation=True)
    assert sorted(got) == sorted(shown) and not strands.modifiers and not messages(), (sorted(got), messages())
    for frame, points in shown.items():
        assert apart(got[frame], points) < 1e-6, frame


def composed_with_another_range(folder: Path) -> None:
    """Two scenes that are rendered together share a character: if one has another range, the panel and the console say that its hair
    may be wrong; with the same settings, it is right. Nothing is left on it afterwards.
    """
    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    strands, got = scenes.hair(rig, 10), {}
    strands.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
    make_live(rig, strands)
    shown = points_at(strands, 14)
    bpy.ops.scene.new(type="LINK_COPY")
    other, bpy.context.window.scene = bpy.context.scene, scene
    for each in (scene, other):
        film(each)
        each.render.filepath = str(folder / each.name)
    _compose(scene, scene, other)
    scene.frame_set(14)

    def look(_engine, graph):
        got[graph.scene.name] = scenes.points(strands, graph)

    for begins in (10, 1):
        other.frame_start = begins
        with witness(look):
            scene.render.engine = other.render.engine = ENGINE
            with redirect_stdout(io.StringIO()) as said:
                bpy.ops.render.render()
        assert ("it is rendered with other scenes" in said.getvalue()) == (begins == 10), said.getvalue()
        assert (apart(got[scene.name], shown) < 1e-6) == (begins == 1), begins
        assert not strands.modifiers


def _compose(scene, *others) -> None:
    """Use other scenes' layers in the compositor of a scene."""
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        target = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        target = tree.nodes.new("CompositorNodeComposite")
    for other in others:
        layer = tree.nodes.new("CompositorNodeRLayers")
        layer.scene = other
        tree.links.new(layer.outputs[0], target.inputs[0])
