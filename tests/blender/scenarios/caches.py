# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake and Attach as time goes by, and how what is attached is drawn."""

import shutil
from pathlib import Path
from unittest import SkipTest

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, messages, needs_usd, points_at


def attached_again(folder: Path) -> None:
    """Attached hair is saved, opened elsewhere, attached again with another look, also when its files are gone, and its cache is
    removed.
    """
    needs_usd()
    operators, here = bpy.ops.neuralocks, folder / "here"
    rig, strands = scenes.dancer(20)
    here.mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(here / "shot.blend"))
    bpy.context.scene.neuralocks.output = "//cache\\hair.usdc"  # as chosen on Windows
    make_live(rig, strands)
    live = points_at(strands, 9)
    assert operators.bake_attach() == {"FINISHED"}
    bpy.ops.wm.save_mainfile()

    there = folder / "there"
    shutil.move(here, there)

    def opened():
        bpy.ops.wm.open_mainfile(filepath=str(there / "shot.blend"))
        return bpy.data.objects["Hair"]

    strands = opened()
    assert apart(points_at(strands, 9), live) < SAME, "the cache did not move with the file"
    assert operators.sample_motion() == {"FINISHED"}
    strands.neuralocks_hair.motion = 0.2
    strands.neuralocks_hair.live = True
    slow = points_at(strands, 9)
    assert apart(slow, live) > 1e-3 and not messages(), messages()
    assert operators.bake_attach() == {"FINISHED"}
    assert apart(points_at(strands, 9), slow) < SAME, "the cache from before is shown"
    bpy.ops.wm.save_mainfile()

    shutil.rmtree(there / "cache")
    strands = opened()
    assert operators.bake_attach() == {"FINISHED"}
    assert apart(points_at(strands, 9), slow) < SAME
    bpy.ops.wm.save_mainfile()
    opened()
    assert operators.detach() == {"FINISHED"}
    assert not bpy.data.objects["Hair"].modifiers and not bpy.data.cache_files


def baked_over(folder: Path) -> None:
    """A bake to the file that hair plays is shown at once, as it is when the file is opened again; also if the hair has another
    name in it.
    """
    needs_usd()
    operators, rig, scene = bpy.ops.neuralocks, scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    strands, out = scenes.hair(rig, 20, name="Hair.L"), str(folder / "hair.usdc")
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    make_live(rig, strands)
    scene.neuralocks.output = out
    assert operators.bake_attach() == {"FINISHED"}
    first = points_at(strands, 9)
    scenes.hair(rig, 10, name="Hair L").neuralocks_hair.model = strands.neuralocks_hair.model
    for motion in (0.2, 1.0):
        for hair in (strands, bpy.data.objects["Hair L"]):
            hair.neuralocks_hair.motion = motion
        assert operators.bake() == {"FINISHED"}
        shown = points_at(strands, 9)
        prim = strands.modifiers["Neuralocks Cache"].object_path
        assert apart(shown, baked_points(out, prim, 9)) < SAME, "the cache from before is shown"
        assert (apart(shown, first) > 1e-3) == (motion == 0.2)
    assert not messages(), messages()
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    assert apart(points_at(bpy.data.objects["Hair.L"], 9), shown) < SAME


def held_elsewhere(folder: Path) -> None:
    """A bake over a file is shown although more than the view plays it: a render with persistent data, another view layer, or another
    object with a cache of its own.
    """
    needs_usd()
    operators, rig, scene = bpy.ops.neuralocks, scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    scene.frame_end, scene.neuralocks.output = 10, str(folder / "hair.usdc")
    scene.collection.objects.link(camera := bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    scene.camera, scene.render.engine, scene.render.use_persistent_data = camera, "CYCLES", True
    scene.render.resolution_x, scene.render.resolution_y, scene.cycles.samples = 8, 8, 1
    make_live(rig, strands)

    def attached(motion: float) -> None:
        strands.neuralocks_hair.motion, strands.neuralocks_hair.live = motion, True
        live = points_at(strands, 9)
        assert operators.bake_attach() == {"FINISHED"}
        assert apart(points_at(strands, 9), live) < SAME, "the cache from before is shown"

    attached(1.0)
    bpy.ops.render.render()
    attached(0.2)
    assert scene.render.use_persistent_data
    layers, window = scene.view_layers, bpy.context.window
    for layer in (layers.new("Other"), layers[0]):
        window.view_layer = layer
        points_at(strands, 5)
    attached(1.0)
    strands.neuralocks_hair.motion = 0.2
    twin = strands.copy()
    twin.data = strands.data.copy()
    scene.collection.objects.link(twin)
    own = twin.modifiers["Neuralocks Cache"]
    own.cache_file = own.cache_file.copy()
    before = points_at(twin, 9)
    assert operators.bake() == {"FINISHED"}
    for hair in (strands, twin):
        prim = hair.modifiers["Neuralocks Cache"].object_path
        shown = points_at(hair, 9)
        assert apart(shown, baked_points(scene.neuralocks.output, prim, 9)) < SAME < apart(shown, before), hair.name


def taken_off(folder: Path) -> None:
    """A cache plays the baked frames even if time is stretched; when it is removed, even while live is on, the hair follows its
    surface as before.
    """
    needs_usd()
    operators, rig, scene = bpy.ops.neuralocks, scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    deform = scenes.surface_deform(strands)
    scene.render.frame_map_old, scene.render.frame_map_new = 100, 200
    make_live(rig, strands)
    live = {frame: points_at(strands, frame) for frame in (1, 9, 20)}
    scene.neuralocks.output = str(folder / "hair.usdc")
    for beside in (False, True):
        assert operators.bake_attach() == {"FINISHED"}
        assert all(apart(points_at(strands, frame), shown) < SAME for frame, shown in live.items())
        assert not deform.show_viewport and not deform.show_render
        strands.neuralocks_hair.live = beside
        assert operators.detach() == {"FINISHED"}
        assert deform.show_viewport is deform.show_render is not beside, "hair that is live is moved twice"
        strands.neuralocks_hair.live = False
        assert deform.show_viewport and deform.show_render, "the hair stays behind its surface"
        assert [modifier.name for modifier in strands.modifiers] == [deform.name] and not messages(), messages()
        assert not bpy.data.cache_files, "a cache that nothing plays goes into the file"
    assert operators.bake_attach() == {"FINISHED"}
    strands.modifiers.remove(strands.modifiers["Neuralocks Cache"])  # by hand
    assert operators.detach() == {"FINISHED"} and deform.show_viewport and deform.show_render


def drawn_alike(folder: Path) -> None:
    """Live and attached hair have the same smooth curves, thickness and bounds; Bezier strands, whose handles are not points, are
    refused.
    """
    if "set_types" not in bpy.types.Curves.bl_rna.functions:
        if "add_curves" not in bpy.types.Curves.bl_rna.functions:
            raise SkipTest("scripts make no curves in this Blender")
        kinds = ["CATMULL_ROM"]
    else:
        kinds = ["CATMULL_ROM", "POLY", "NURBS", "BEZIER"]
    scene = bpy.context.scene
    rig = scenes.armature()
    scenes.dance(rig)
    for kind in kinds:
        counts = [6, 6, 8]
        data = bpy.data.hair_curves.new(kind)
        data.add_curves(counts)
        if kind != "CATMULL_ROM":
            data.set_types(type=kind)
        along = np.concatenate([np.linspace(0, 1, count) for count in counts])
        turn = np.repeat([0, 1, 2], counts) + 6 * along
        points = np.stack([0.08 * np.cos(turn), 0.08 * np.sin(turn), 1.72 - 0.25 * along], axis=1)
        data.attributes["position"].data.foreach_set("vector", points.astype(np.float32).ravel())
        if kind == "POLY" and bpy.app.version >= (5, 0):  # one radius for each strand, as geometry nodes may leave it
            data.attributes.new("radius", "FLOAT", "CURVE").data.foreach_set("value", [0.001, 0.003, 0.002])
        strands = bpy.data.objects.new(kind, data)
        scene.collection.objects.link(strands)
        strands.parent = rig
        make_live(rig, strands)
        if kind == "BEZIER":
            assert "Catmull Rom" in messages()["BEZIER"], messages()
            assert apart(points_at(strands, 9), points_at(strands, 1)) > 0.01, "it goes with its parent, and no more"
            assert "neuralocks_rest" not in data.attributes
            continue
        live = _drawn(strands, 1), _drawn(strands, 9)
        assert not messages(), messages()
        assert apart(live[0][0], live[1][0]) > 0.01, "the smooth curves stayed behind"
        assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / f"{kind}.usdc")) == {"FINISHED"}
        for frame, (smooth, radius, bounds) in zip((1, 9), live):
            attached = _drawn(strands, frame)
            assert apart(attached[0], smooth) < SAME, kind
            assert abs(attached[1] - radius) < 1e-6, kind
            for found in (bounds, attached[2]):  # with up to 10 mm for the thickness
                assert apart(found, np.stack([smooth.min(axis=0), smooth.max(axis=0)])) < 0.011, kind


def blurred_alike(folder: Path) -> None:
    """Attached hair is blurred like live hair: Cycles draws both where they are between the frames if there are samples, also after
    a bake over the same file, and otherwise along velocities, which a bake for other programs always has.
    """
    needs_usd()
    if bpy.app.version < (4, 5):
        raise SkipTest("this Blender reads no velocities of hair")
    rig, scene, out = scenes.armature(), bpy.context.scene, str(folder / "hair.usdc")
    scenes.dance(rig)
    scene.frame_end = 12
    strands = scenes.hair(rig, 20)
    make_live(rig, strands)

    def velocities() -> bool:
        attributes = strands.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.attributes
        return "velocity" in attributes

    assert bpy.ops.neuralocks.bake_attach(filepath=out) == {"FINISHED"} and velocities()
    scene.neuralocks.subframes = 4
    assert bpy.ops.neuralocks.detach() == {"FINISHED"}
    make_live(rig, strands)
    live = points_at(strands, 9, 0.25)
    for bake in (bpy.ops.neuralocks.bake_attach, bpy.ops.neuralocks.bake):
        assert bake(filepath=out) == {"FINISHED"}
        assert apart(points_at(strands, 9, 0.25), live) < SAME
        assert not velocities(), "Cycles leaves out the samples between the frames"
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "other.usdc")) == {"FINISHED"}
    from pxr import Usd

    stage = Usd.Stage.Open(str(folder / "other.usdc"))
    assert stage.GetAttributeAtPath("/Character/Hair_Hair.velocities").GetNumTimeSamples()


def _drawn(strands, frame: int) -> tuple:
    """Points (N, 3) of the curves with their steps in between, as geometry nodes get them, largest radius, and bounds
    (2, 3), all in the object's space.
    """
    scene = bpy.context.scene
    mesh = bpy.data.meshes.new("Probe")
    probe = bpy.data.objects.new("Probe", mesh)
    scene.collection.objects.link(probe)
    tree = bpy.data.node_groups.new("Probe", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    source, drawn = tree.nodes.new("GeometryNodeObjectInfo"), tree.nodes.new("GeometryNodeCurveToMesh")
    source.inputs[0].default_value = strands
    tree.links.new(source.outputs["Geometry"], drawn.inputs[0])
    tree.links.new(drawn.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    probe.modifiers.new("Probe", "NODES").node_group = tree
    scene.frame_set(frame)
    graph = bpy.context.evaluated_depsgraph_get()
    smooth = np.array([vertex.co for vertex in probe.evaluated_get(graph).data.vertices])
    evaluated = strands.evaluated_get(graph)
    radius = evaluated.data.attributes.get("radius")
    # Cycles draws hair without this attribute this thick.
    thick = 0.005 if radius is None else max(value.value for value in radius.data)
    corners = np.array([corner[:] for corner in evaluated.bound_box])
    bpy.data.objects.remove(probe)
    bpy.data.node_groups.remove(tree)
    bpy.data.meshes.remove(mesh)
    return smooth, thick, np.stack([corners.min(axis=0), corners.max(axis=0)])
