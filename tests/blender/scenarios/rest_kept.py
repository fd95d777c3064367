# SPDX-License-Identifier: GPL-3.0-or-later
"""The rest shape of live hair, while modifiers are applied that change how many points there are, and while the attribute
that it lies in is changed by hand, and in files that Blender's own exporter writes.
"""

from pathlib import Path
from unittest import SkipTest

import bpy
import numpy as np

from dcc_addon.handlers import on_update
from dcc_addon.scene.hair import curves
from dcc_addon.scene.hair.nodes import geometry_nodes
from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, baked_points, choose, make_live, messages, needs_usd, points_at


def applied_to_other_points(_folder: Path) -> None:
    """A modifier that multiplies or resamples strands is applied to live hair or lost in a conversion: Live goes off and says so,
    every time; after an undo, the hair and its modifier are as before.
    """
    for tree in (_children, _frizz):
        for done in (_apply, _convert):
            scenes.empty()
            rig, strands = scenes.dancer(20)
            groom = curves.points(strands.data)
            strands.modifiers.new("Grown", "NODES").node_group = tree()
            make_live(rig, strands)
            shown = points_at(strands, 9)
            choose(strands)
            bpy.ops.ed.undo_push(message="before")
            updates = bpy.app.handlers.depsgraph_update_post
            updates.remove(on_update)
            done()
            bpy.ops.ed.undo_push(message="done")  # Blender does this before it calls handlers
            updates.append(on_update)
            strands.update_tag()
            bpy.context.view_layer.update()
            strands = bpy.data.objects["Hair"]
            assert "'Grown' was applied" in messages()["Hair"] and not strands.neuralocks_hair.live, messages()
            if bpy.app.version < (4, 0):  # without a window, older ones keep no undo steps
                continue
            bpy.ops.ed.undo()
            strands = bpy.data.objects["Hair"]
            assert strands.neuralocks_hair.live and "Grown" in strands.modifiers and not messages(), messages()
            assert apart(curves.points(strands.data), groom) == 0.0
            assert apart(points_at(strands, 9), shown) < 1e-6
            bpy.ops.ed.redo()
            strands = bpy.data.objects["Hair"]
            assert "'Grown' was applied" in messages()["Hair"] and not strands.neuralocks_hair.live, messages()


def strands_after_a_modifier(_folder: Path) -> None:
    """Strands that are added to live hair after a modifier was removed are not taken as that modifier's work."""
    rig, strands = scenes.dancer(20)
    if not hasattr(strands.data, "add_curves"):
        raise SkipTest("no strands can be added yet")
    modifier = strands.modifiers.new("Grown", "NODES")
    modifier.node_group = _frizz()
    make_live(rig, strands)
    points_at(strands, 9)
    strands.modifiers.remove(modifier)
    bpy.context.view_layer.update()
    strands.data.add_curves([24])
    end = np.float32([[0, 0.05, 1.7 - 0.01 * k] for k in range(24)])
    curves.write(strands.data, np.concatenate([curves.shown(strands.data)[:-24], end]))
    strands.data.update_tag()
    bpy.context.view_layer.update()
    assert strands.neuralocks_hair.live and not messages(), messages()
    assert apart(curves.points(strands.data)[-24:], end) == 0.0


def attribute_gone(_folder: Path) -> None:
    """Live hair continues, and has its groom, when the attribute is removed, renamed or converted by hand, or by an applied
    modifier.
    """
    rig, strands = scenes.dancer(20)
    groom = curves.points(strands.data)
    tree, source, target = geometry_nodes("Clean")
    node = tree.nodes.new("GeometryNodeRemoveAttribute")
    node.inputs["Name"].default_value = curves.REST
    tree.links.new(source, node.inputs[0])
    tree.links.new(node.outputs[0], target)

    def remove(data):
        data.attributes.remove(data.attributes[curves.REST])

    def rename(data):
        data.attributes[curves.REST].name = "mine"

    def convert(data):
        remove(data)
        data.attributes.new(curves.REST, "FLOAT", "POINT")

    def apply(_data):
        strands.modifiers.new("Grown", "NODES").node_group = tree
        _apply()

    make_live(rig, strands)
    shown = {frame: points_at(strands, frame) for frame in (5, 9)}
    choose(strands)
    for change in (remove, rename, convert, apply):
        change(strands.data)
        strands.data.update_tag()
        bpy.context.view_layer.update()
        assert curves.has_rest(strands.data) and apart(curves.points(strands.data), groom) == 0.0, change
        for frame, points in shown.items():
            assert apart(points_at(strands, frame), points) < 1e-6, change
        assert strands.neuralocks_hair.live and not messages(), messages()
    strands.neuralocks_hair.live = False
    assert np.array_equal(curves.shown(strands.data), groom)


def exported_by_blender(folder: Path) -> None:
    """Blender's own exporter writes live hair as it is shown, and its rest shape with it: a bake moves the rest shape, so no hair
    moves twice.
    """
    needs_usd()
    from usd.baking.bake import bake

    rig = scenes.armature()
    scenes.body(rig)
    scenes.dance(rig, (-11, 24))
    make_live(rig, scenes.hair(rig, 20), resolve=False)
    shown = {frame: points_at(bpy.data.objects["Hair"], frame) for frame in (2, 13)}
    bpy.context.scene.frame_set(9)
    file, baked = folder / "export.usdc", folder / "baked.usdc"
    bpy.ops.wm.usd_export(filepath=str(file), export_animation=True, export_armatures=True, export_materials=False)
    result = bake(file, baked, Path(MODEL), resolve=False)
    assert any("Live was on" in note for note in result.notes), result.notes
    for frame, points in shown.items():
        assert apart(baked_points(baked, result.grooms[0]["path"], frame), points) < SAME, frame


def _apply() -> None:
    bpy.ops.object.modifier_apply(modifier="Grown")


def _convert() -> None:
    bpy.ops.object.convert(target="CURVES")


def _children():
    """A tree that makes three of each strand, side by side."""
    tree, source, target = geometry_nodes("Children")
    twice, place, offset = (
        tree.nodes.new(name)
        for name in ("GeometryNodeDuplicateElements", "GeometryNodeSetPosition", "ShaderNodeCombineXYZ")
    )
    twice.domain = "SPLINE"
    twice.inputs["Amount"].default_value = 3
    for one, other in (
        (source, twice.inputs[0]),
        (twice.outputs[0], place.inputs[0]),
        (twice.outputs[1], offset.inputs[0]),
        (offset.outputs[0], place.inputs["Offset"]),
        (place.outputs[0], target),
    ):
        tree.links.new(one, other)
    return tree


def _frizz():
    """A tree that gives strands other points, and moves them."""
    tree, source, target = geometry_nodes("Frizz")
    resample, place = (tree.nodes.new(f"GeometryNode{name}") for name in ("ResampleCurve", "SetPosition"))
    resample.inputs["Count"].default_value = 32
    place.inputs["Offset"].default_value = (0, 0.02, 0)
    for one, other in (
        (source, resample.inputs[0]),
        (resample.outputs[0], place.inputs[0]),
        (place.outputs[0], target),
    ):
        tree.links.new(one, other)
    return tree
