# SPDX-License-Identifier: GPL-3.0-or-later
"""Modifiers on hair that the live view, or a cache, has already moved."""

from pathlib import Path

import bpy

from dcc_addon.scene.hair.nodes import geometry_nodes
from dcc_addon.session import session
from tests.blender import scenes
from tests.blender.checks import make_live, messages, points_at

HAS_USD = getattr(bpy.app.build_options, "usd", False)


def deform_among_others(folder: Path) -> None:
    """In a user's own tree that multiplies strands and lets them follow the surface, the live view and a cache disable only the
    following; all of it comes back, also while the hair is edited.
    """
    rig, strands = scenes.dancer(20)
    strands.data.surface, strands.data.surface_uv_map = scenes.body(rig), "UVMap"
    tree, source, target = geometry_nodes("Groom")
    deform, twice = (tree.nodes.new(f"GeometryNode{name}") for name in ("DeformCurvesOnSurface", "DuplicateElements"))
    twice.domain = "SPLINE"
    twice.inputs["Amount"].default_value = 3
    for one, other in ((source, twice.inputs[0]), (twice.outputs[0], deform.inputs[0]), (deform.outputs[0], target)):
        tree.links.new(one, other)
    modifier = strands.modifiers.new("Groom", "NODES")
    modifier.node_group = tree

    def drawn() -> int:
        evaluated = strands.evaluated_get(bpy.context.evaluated_depsgraph_get())
        return len(evaluated.data.curves)

    count = drawn()
    assert count > len(strands.data.curves)
    make_live(rig, strands)
    points_at(strands, 9)
    assert drawn() == count and modifier.show_viewport and modifier.show_render and not messages(), messages()
    assert not strands.data.surface_uv_map
    bpy.context.view_layer.objects.active = strands
    if bpy.app.version >= (3, 5):  # older ones have no such mode
        bpy.ops.object.mode_set(mode="SCULPT_CURVES")
        bpy.context.view_layer.update()
        assert strands.data.surface_uv_map == "UVMap"
        bpy.ops.object.mode_set(mode="OBJECT")
        points_at(strands, 8)
        assert not strands.data.surface_uv_map
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"), copy=True)
    with bpy.data.libraries.load(str(folder / "shot.blend")) as (_, there):
        there.hair_curves = ["Hair"]
    assert there.hair_curves[0].surface_uv_map == "UVMap" and not strands.data.surface_uv_map
    if HAS_USD:
        bpy.context.scene.neuralocks.output = str(folder / "cache.usdc")
        assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
        assert drawn() == count and not strands.data.surface_uv_map
        strands.neuralocks_hair.live = True
        strands.neuralocks_hair.live = False
        assert not strands.data.surface_uv_map
        assert bpy.ops.neuralocks.detach() == {"FINISHED"}
        assert strands.data.surface_uv_map == "UVMap"
        strands.neuralocks_hair.live = True
        assert not strands.data.surface_uv_map
    strands.neuralocks_hair.live = False
    assert strands.data.surface_uv_map == "UVMap" and drawn() == count
    assert not [key for key in strands.data.keys() if "neuralocks" in key]

    from dcc_addon.scene.hair.muting import off_meanwhile

    strands.data.use_fake_user, other = True, bpy.data.objects.new("Other", strands.data)
    bpy.context.scene.collection.objects.link(other)
    plain = scenes.surface_deform(strands)
    make_live(rig, strands)  # refused, because the curves are shared
    assert "several objects share" in messages()["Hair"] and strands.data.surface_uv_map == "UVMap"
    bpy.data.objects.remove(other)
    points_at(strands, 9)
    assert not messages() and off_meanwhile(strands) == [plain.name] and modifier.show_viewport


def left_out_of_the_file(folder: Path) -> None:
    """A bake names the modifiers that are not in its file: those that would play on top of an attached cache, and no others."""
    from types import SimpleNamespace

    from dcc_addon.operators.bake import NEURALOCKS_OT_bake

    rig, strands = scenes.dancer(10)
    make_live(rig, strands)

    def said() -> str:
        told: list[str] = []
        operator = SimpleNamespace(filepath=str(folder / "bake.usdc"), report=lambda kind, line: told.append(line))
        for _ in NEURALOCKS_OT_bake.steps(operator, bpy.context):
            pass
        return told[0]

    scenes.surface_deform(strands)
    assert said() == f"Baked to {folder / 'bake.usdc'}"
    for name, shown in (("Frizz", True), ("Curl", True), ("Old", False)):
        modifier = strands.modifiers.new(name, "NODES")
        modifier.node_group = geometry_nodes(name)[0]
        modifier.show_viewport = modifier.show_render = shown
    assert said().endswith("; not in the file: modifiers 'Frizz', 'Curl' (Bake and Attach plays below them)"), said()


def switched_over_time(folder: Path) -> None:
    """What shows or hides a modifier over time, keys or drivers, does not switch it on while the hair is live or plays a cache, and
    does so again afterwards; the motion is not out of date for that.
    """
    from dcc_addon.scene.hair.muting import off_meanwhile
    from dcc_addon.scene.motion.up_to_date import notice

    rig, strands = scenes.dancer(20)
    scene = bpy.context.scene
    strands.data.surface = scenes.body(rig)
    modifier, own = scenes.surface_deform(strands), strands.neuralocks_hair
    for frame, shown in ((1, False), (5, True)):
        for setting in ("show_viewport", "show_render"):
            setattr(modifier, setting, shown)
            modifier.keyframe_insert(setting, frame=frame)
    keys, muted, driver = *scenes.fcurves(strands), modifier.driver_add("show_render")
    driver.driver.expression, muted.mute = "frame > 4", True
    curves = {"driver": driver, "keys": keys}

    def plays() -> bool:
        now = [not curve.mute for curve in curves.values()]
        assert len(set(now)) == 1 and muted.mute, now
        return now[0]

    def shown_at(frame) -> list[bool]:
        points_at(strands, frame)
        bpy.context.view_layer.update()
        return [modifier.show_viewport, modifier.show_render]

    as_keyed = {frame: shown_at(frame) for frame in (3, 9)}
    assert plays() and as_keyed == {3: [False, False], 9: [True, True]}
    for frame in (3, 9):
        scene.frame_set(frame)
        make_live(rig, strands)
        bpy.context.view_layer.update()
        for at in (4, 9, 2, 10):
            assert shown_at(at) == [False, False] and not plays() and not messages(), messages()
        notice(rig, scene)
        assert not session.rigs["Rig"].stale and off_meanwhile(strands) == [modifier.name]
        own.live = False
        assert plays() and {at: shown_at(at) for at in as_keyed} == as_keyed
    if HAS_USD:
        scene.frame_set(3)
        assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / "cache.usdc")) == {"FINISHED"}
        assert shown_at(9) == [False, False] and not plays()
        assert bpy.ops.neuralocks.detach() == {"FINISHED"}
        assert plays() and {at: shown_at(at) for at in as_keyed} == as_keyed
    make_live(rig, strands)
    shown_at(9)
    modifier.name = "Renamed"
    own.live = False
    assert plays() and {at: shown_at(at) for at in as_keyed} == as_keyed
    for text in (
        '{"Renamed": [true, true, "keys"]}',
        '{"Renamed": [true, true, 5]}',
        '{"Renamed": [true, [], "keys of name"]}',
    ):
        own.muted = text
        own.live = True
        shown_at(9)
        own.live = False
        assert plays() and {at: shown_at(at) for at in as_keyed} == as_keyed
