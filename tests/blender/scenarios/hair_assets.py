# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own hair assets on hair that is live or plays a cache."""

import math
import os
from pathlib import Path
from unittest import SkipTest

import bmesh
import bpy
import numpy as np

from dcc_addon.scene.hair.nodes import geometry_nodes, inputs_of, read_input, write_input
from tests.blender import scenes
from tests.blender.checks import MODEL, apart, make_live, messages, points_at

RESTING = ("Surface Rest Position", "Resting Surface")
HAS_USD = getattr(bpy.app.build_options, "usd", False)


def resting_surface(folder: Path) -> None:
    """The switch of Blender's hair assets that uses the surface at rest is off while the hair is live or plays a cache, and is
    restored in every way of ending that, whatever the modifier's name is by then; what the artist had off stays off.
    """
    rig, strands = scenes.dancer(20)
    wanted = {}
    for number, (label, value) in enumerate(
        [*zip(RESTING, (True, True), strict=True), (RESTING[0], False), ("On", True)]
    ):
        modifier = strands.modifiers.new(f"Grow {number}", "NODES")
        modifier.node_group = _lifting(label)
        write_input(modifier, _input(modifier, label), value)
        wanted[modifier.name] = value
    shown = points_at(strands, 9)

    def switches():
        hair = bpy.data.objects["Hair"]
        return {
            m.name: bool(read_input(m, inputs_of(m.node_group)[-1][1])) for m in hair.modifiers if m.type == "NODES"
        }

    def off() -> bool:
        return switches() == {**dict.fromkeys(wanted, False), "Grow 3": True}

    assert switches() == wanted
    make_live(rig, strands)
    points_at(strands, 12)
    assert off() and not messages(), messages()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"), copy=True)
    assert off()
    with bpy.data.libraries.load(str(folder / "shot.blend")) as (_, there):
        there.objects = ["Hair"]
    saved = {m.name: bool(read_input(m, inputs_of(m.node_group)[-1][1])) for m in there.objects[0].modifiers}
    assert saved == wanted, saved
    bpy.data.objects.remove(there.objects[0])
    if bpy.app.version >= (4, 0):  # without a window, older ones keep no undo steps
        strands.neuralocks_hair.live = False
        bpy.ops.ed.undo_push(message="rest")
        bpy.data.objects["Hair"].neuralocks_hair.live = True
        bpy.ops.ed.undo_push(message="live")
        for step, live in ((bpy.ops.ed.undo, False), (bpy.ops.ed.redo, True)):
            step()
            assert off() if live else switches() == wanted, (live, switches())
    strands = bpy.data.objects["Hair"]
    if HAS_USD:
        bpy.context.scene.neuralocks.output = str(folder / "cache.usdc")
        assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
        assert not strands.neuralocks_hair.live and off()
        strands.neuralocks_hair.live = True
        assert bpy.ops.neuralocks.detach() == {"FINISHED"} and off()
    strands.modifiers["Grow 0"].name = "Renamed"
    points_at(strands, 9)
    strands.neuralocks_hair.live = False
    strands.modifiers["Renamed"].name = "Grow 0"
    assert switches() == wanted and not strands.neuralocks_hair.muted
    assert apart(points_at(strands, 9), shown) < 1e-6


def grown_by_assets(_folder: Path) -> None:
    """Children from Blender's own hair assets grow on the moving skin, with Live as without, before the modifiers in the stack that
    deform the hair.
    """
    if bpy.app.version < (4, 2):
        raise SkipTest("assets of hair are younger")
    rig = scenes.armature()
    scenes.dance(rig)
    head = _head(rig)
    strands = _grown(head)
    asset = _asset("Interpolate Hair Curves")
    modifier = strands.modifiers.new("Children", "NODES")
    modifier.node_group = asset
    strands.modifiers.move(strands.modifiers.find("Children"), 0)
    switch = next(name for name in (_input(modifier, label) for label in RESTING) if name)
    _give(modifier, "Surface", head)
    _give(modifier, "Density", 2000.0)
    _give_map(modifier)
    write_input(modifier, switch, True)
    strands.update_tag()

    def off_the_skin() -> float:
        """Largest distance of a root from the head's skin [m]."""
        graph = bpy.context.evaluated_depsgraph_get()
        curves, skin = strands.evaluated_get(graph), head.evaluated_get(graph)
        places, sizes = np.empty((len(curves.data.points), 3), np.float32), np.empty(len(curves.data.curves), np.int32)
        curves.data.attributes["position"].data.foreach_get("vector", places.ravel())
        curves.data.curves.foreach_get("points_length", sizes)
        assert len(sizes) > 2 * len(strands.data.curves)
        roots = np.concatenate([[0], np.cumsum(sizes)[:-1]])
        back = skin.matrix_world.inverted() @ curves.matrix_world
        at = [back @ curves.data.points[root].position for root in roots.tolist()]
        return max((skin.closest_point_on_mesh(point)[1] - point).length for point in at)

    bpy.context.scene.frame_set(9)
    assert off_the_skin() < 0.005
    strands.neuralocks_hair.model = MODEL
    make_live(rig, strands, resolve=False)
    bpy.context.scene.frame_set(9)
    assert off_the_skin() < 0.005 and not messages(), (off_the_skin(), messages())
    strands.neuralocks_hair.live = False
    assert read_input(modifier, switch)


def _lifting(label: str):
    """A tree that lifts the hair by 10 cm if its switch of this name is on."""
    tree, source, target = geometry_nodes(f"Lift {label}")
    if hasattr(tree, "interface"):
        tree.interface.new_socket(label, in_out="INPUT", socket_type="NodeSocketBool")
    else:
        tree.inputs.new("NodeSocketBool", label)
    group = source.node
    place = tree.nodes.new("GeometryNodeSetPosition")
    place.inputs["Offset"].default_value = (0, 0, 0.1)
    tree.links.new(source, place.inputs[0])
    tree.links.new(group.outputs[1], place.inputs["Selection"])
    tree.links.new(place.outputs[0], target)
    return tree


def _input(modifier, label: str) -> str:
    return next((identifier for name, identifier in inputs_of(modifier.node_group) if name == label), "")


def _give(modifier, label: str, value) -> None:
    for name, identifier in inputs_of(modifier.node_group):
        if name == label:
            if hasattr(modifier, "properties"):
                getattr(modifier.properties.inputs, identifier).value = value
            else:
                modifier[identifier] = value


def _give_map(modifier) -> None:
    """Name the UV map that the asset reads, if it asks for one."""
    identifier = _input(modifier, "Surface UV Map")
    if not identifier:
        return
    if hasattr(modifier, "properties"):
        given = getattr(modifier.properties.inputs, identifier)
        given.type, given.attribute_name = "ATTRIBUTE", "UVMap"
    else:
        modifier[f"{identifier}_use_attribute"], modifier[f"{identifier}_attribute_name"] = True, "UVMap"


def _asset(name: str):
    """One of the node groups that come with Blender."""
    folder = bpy.utils.system_resource("DATAFILES")
    file = "procedural_hair_node_assets.blend"
    path = next(os.path.join(root, file) for root, _, files in os.walk(folder) if file in files)
    with bpy.data.libraries.load(path) as (_, wanted):
        wanted.node_groups = [name]
    return bpy.data.node_groups[name]


def _head(rig):
    """A ball with a UV map, skinned to the head bone."""
    shape = bmesh.new()
    layer = shape.loops.layers.uv.new("UVMap")
    bmesh.ops.create_uvsphere(shape, u_segments=24, v_segments=16, radius=0.09)
    for face in shape.faces:
        centre = face.calc_center_median()
        middle = math.atan2(centre.y, centre.x)
        for loop in face.loops:
            angle = math.atan2(loop.vert.co.y, loop.vert.co.x) if abs(loop.vert.co.z) < 0.0899 else middle
            angle = middle + (angle - middle + math.pi) % math.tau - math.pi
            loop[layer].uv = (0.5 + 0.9 * angle / math.tau, math.acos(max(-1, min(1, loop.vert.co.z / 0.09))) / math.pi)
    bmesh.ops.translate(shape, verts=shape.verts, vec=(0, 0, 1.66))
    mesh = bpy.data.meshes.new("Head")
    shape.to_mesh(mesh)
    shape.free()
    head = bpy.data.objects.new("Head", mesh)
    bpy.context.scene.collection.objects.link(head)
    head.vertex_groups.new(name="head").add(range(len(mesh.vertices)), 1.0, "REPLACE")
    head.parent = rig
    head.modifiers.new("Armature", "ARMATURE").object = rig
    head.add_rest_position_attribute = True
    return head


def _grown(head):
    """Hair as *Empty Hair* makes it, with strands on the head."""
    for each in bpy.context.selected_objects:
        each.select_set(False)
    bpy.context.view_layer.objects.active = head
    head.select_set(True)
    bpy.ops.object.curves_empty_hair_add()
    strands = bpy.context.active_object
    rng, steps = np.random.default_rng(1), np.linspace(0, 1, 12)[None, :, None]
    out = rng.normal(size=(30, 3))
    out[:, 2] = np.abs(out[:, 2])
    out /= np.linalg.norm(out, axis=1)[:, None]
    points = (
        np.array([0, 0, 1.66]) + 0.09 * out[:, None] + 0.2 * (steps * out[:, None] * 0.5 - steps**2 * [[[0, 0, 0.8]]])
    )
    strands.data.add_curves([12] * 30)
    strands.data.attributes["position"].data.foreach_set("vector", points.reshape(-1, 3).astype(np.float32).ravel())
    strands.data.update_tag()
    bpy.context.view_layer.update()
    with bpy.context.temp_override(active_object=strands, object=strands, selected_editable_objects=[strands]):
        bpy.ops.curves.snap_curves_to_surface(attach_mode="NEAREST")
    return strands
