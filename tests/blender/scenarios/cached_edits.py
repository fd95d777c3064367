# SPDX-License-Identifier: GPL-3.0-or-later
"""Strands that are edited while they play a cache: added, deleted, or given one radius each."""

from pathlib import Path
from unittest import SkipTest

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, make_live, messages, needs_usd, points_at
from tests.blender.panel import drawn


def other_strands_than_baked(folder: Path) -> None:
    """Where strands are deleted, the cache is off until the next bake or an undo: Blender 4.2 would crash, and 5.2 go on to show all
    of them.
    """
    needs_usd()
    if bpy.app.version < (4, 2):
        raise SkipTest("this Blender deletes no strands")
    rig, scene, ops = scenes.armature(), bpy.context.scene, bpy.ops
    scenes.dance(rig)
    make_live(rig, scenes.hair(rig, 12))
    scene.neuralocks.output = str(folder / "hair.usdc")

    def strands():
        return bpy.data.objects["Hair"]

    def is_shown() -> bool:
        cache = strands().modifiers["Neuralocks Cache"]
        assert cache.show_viewport == cache.show_render
        return cache.show_viewport

    def keep(count: int) -> None:
        bpy.context.view_layer.objects.active = strands()
        ops.object.mode_set(mode="EDIT")
        ops.curves.set_selection_domain(domain="CURVE")
        ops.curves.select_all(action="DESELECT")
        for index in range(len(strands().data.curves) - count):
            strands().data.attributes[".selection"].data[index].value = True
        ops.curves.delete()
        bpy.context.view_layer.update()
        assert not is_shown()
        ops.object.mode_set(mode="OBJECT")
        bpy.context.view_layer.update()

    assert ops.neuralocks.bake_attach() == {"FINISHED"}
    every = points_at(strands(), 9)
    ops.ed.undo_push(message="Attached")
    keep(8)
    ops.ed.undo_push(message="Deleted")
    assert [len(points_at(strands(), frame)) for frame in (3, 12)] == [8 * 24] * 2
    note = "Its strands were changed since the bake,"
    assert note in drawn("INFO"), drawn("INFO")
    ops.ed.undo()
    assert is_shown() and apart(points_at(strands(), 9), every) < SAME and note not in drawn("INFO")
    keep(8)
    assert ops.neuralocks.bake_attach() == {"FINISHED"} and is_shown()
    assert apart(points_at(strands(), 9), points_at(strands(), 1)) > 1e-3 and len(points_at(strands(), 9)) == 8 * 24
    assert note not in drawn("INFO"), (dict(strands().data.items()), drawn("INFO"))
    keep(6)
    assert ops.neuralocks.bake() == {"FINISHED"} and is_shown(), "the same file holds the new strands"
    cache = strands().modifiers["Neuralocks Cache"]
    cache.show_viewport = cache.show_render = False
    assert ops.neuralocks.bake() == {"FINISHED"} and not is_shown(), "the artist has hidden it"
    assert not messages(), messages()


def one_of_two_taken_off(folder: Path) -> None:
    """Two objects have the same curves, both with a cache: after one is detached, the other's is still off where strands are deleted."""
    needs_usd()
    if bpy.app.version < (4, 2):
        raise SkipTest("this Blender deletes no strands")
    rig, strands = scenes.dancer(12)
    scene = bpy.context.scene
    make_live(rig, strands)
    twin = strands.copy()
    scene.collection.objects.link(twin)
    for hair in (strands, twin):
        scene.neuralocks.hair = hair
        assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / f"{hair.name}.usdc")) == {"FINISHED"}
    scene.neuralocks.hair = strands
    assert bpy.ops.neuralocks.detach() == {"FINISHED"}
    cache = twin.modifiers["Neuralocks Cache"]
    assert cache.show_viewport and "Neuralocks Cache" not in strands.modifiers
    twin.data.add_curves([24, 24])
    twin.data.update_tag()
    bpy.context.view_layer.update()
    assert not cache.show_viewport and not cache.show_render


def one_radius_each(folder: Path) -> None:
    """Where strands get one radius each, their cache with widths is off until the next bake: Blender since 5.0 would crash, or write
    beyond the radii. That bake leaves the radii alone, and renderers that read primvars find them in the file all the same.
    """
    needs_usd()
    if bpy.app.version < (5, 0):
        raise SkipTest("radii are of points in this Blender")
    from pxr import Usd, UsdGeom

    rig, strands = scenes.dancer(12)
    ops, out, radii = bpy.ops.neuralocks, str(folder / "hair.usdc"), np.linspace(1e-3, 3e-3, 12, dtype=np.float32)

    def give(domain: str) -> None:
        attributes = strands.data.attributes
        if "radius" in attributes:
            attributes.remove(attributes["radius"])
        values = radii if domain == "CURVE" else np.repeat(radii, 24)
        attributes.new("radius", "FLOAT", domain).data.foreach_set("value", values)
        strands.data.update_tag()
        bpy.context.view_layer.update()

    def is_shown() -> bool:
        cache = strands.modifiers["Neuralocks Cache"]
        assert cache.show_viewport == cache.show_render
        return cache.show_viewport and apart(points_at(strands, 9), points_at(strands, 1)) > 1e-3

    def played() -> tuple[str, np.ndarray]:
        found = strands.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.attributes["radius"]
        values = np.empty(len(found.data), np.float32)
        found.data.foreach_get("value", values)
        return found.domain, values

    def has_widths(path: str) -> bool:  # that Blender reads
        stage = Usd.Stage.Open(path)
        curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Character/Hair_Hair"))
        primvar, own = UsdGeom.PrimvarsAPI(curves).GetPrimvar("widths"), curves.GetWidthsAttr().HasAuthoredValue()
        assert primvar.HasValue() != own
        found = np.array(curves.GetWidthsAttr().Get() if own else primvar.Get())
        assert apart(found, 2 * np.repeat(radii, 24)) < 1e-7
        return own

    give("POINT")
    make_live(rig, strands)
    assert ops.bake_attach(filepath=out) == {"FINISHED"} and is_shown() and has_widths(out)
    give("CURVE")
    note = "Its strands were changed since the bake,"
    assert not is_shown() and note in drawn("INFO")
    for bake in (ops.bake_attach, ops.bake):
        assert bake(filepath=out) == {"FINISHED"} and is_shown() and note not in drawn("INFO")
        domain, values = played()
        assert domain == "CURVE" and apart(values, radii) < 1e-7 and not has_widths(out)
    other = str(folder / "other.usdc")
    assert ops.bake(filepath=other) == {"FINISHED"} and has_widths(other)
    give("POINT")
    assert not is_shown() and note in drawn("INFO")
    assert ops.bake(filepath=out) == {"FINISHED"} and is_shown() and has_widths(out)
    domain, values = played()
    assert domain == "POINT" and apart(values, np.repeat(radii, 24)) < 1e-7 and not messages(), messages()
