# SPDX-License-Identifier: GPL-3.0-or-later
"""Undo."""

from pathlib import Path
from unittest import SkipTest

import bpy
import numpy as np

from neuralocks_core.rotation import transformed
from tests.blender import scenes
from tests.blender.checks import MODEL, SAME, apart, make_live, messages, points_at


def undo(folder: Path) -> None:
    """Undo and redo after Live, a slider, a bake with its cache and keyframes: the scene is whole, the view right."""
    if bpy.app.version < (4, 0):
        raise SkipTest("without a window, older ones keep no undo steps")
    push, back, again = bpy.ops.ed.undo_push, bpy.ops.ed.undo, bpy.ops.ed.redo

    def own():
        return bpy.data.objects["Hair"]

    rig, strands = scenes.dancer(20)
    scene = bpy.context.scene
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands
    strands.neuralocks_hair.model = MODEL
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    scene.frame_set(9)
    push(message="groomed")
    groomed = scenes.points(own())
    own().neuralocks_hair.live = True
    push(message="live")
    live = scenes.points(own())
    own().neuralocks_hair.motion = 0.2
    push(message="slider")
    slow = scenes.points(own())
    assert apart(live, groomed) > 0.01 and apart(slow, live) > 0.001

    back()
    assert own().neuralocks_hair.motion == 1.0 and apart(scenes.points(own()), live) == 0.0
    back()
    assert not own().neuralocks_hair.live and "neuralocks_rest" not in own().data.attributes
    assert apart(scenes.points(own()), groomed) == 0.0
    again()
    assert apart(scenes.points(own()), live) == 0.0
    again()
    assert apart(scenes.points(own()), slow) == 0.0
    again_at = bpy.context.scene
    again_at.frame_set(14)
    after = scenes.points(own())

    if getattr(bpy.app.build_options, "usd", True):
        push(message="before the bake")
        assert bpy.ops.neuralocks.bake_attach(filepath=str(folder / "cache.usdc")) == {"FINISHED"}
        push(message="attached")
        assert "Neuralocks Cache" in own().modifiers and not own().neuralocks_hair.live
        back()
        assert "Neuralocks Cache" not in own().modifiers and own().neuralocks_hair.live
        bpy.context.scene.frame_set(14)
        assert apart(scenes.points(own()), after) == 0.0
    own().neuralocks_hair.live = False
    own_points = np.array([p.position for p in own().data.points])
    own().neuralocks_hair.live = True
    own().neuralocks_hair.live = False
    assert apart(np.array([p.position for p in own().data.points]), own_points) == 0.0
    assert not messages(), messages()


def live_undone(_folder: Path) -> None:
    """What kept hair from being live is no longer told once Live is undone; redone, it is told again."""
    if bpy.app.version < (4, 0):
        raise SkipTest("without a window, older ones keep no undo steps")
    rig, strands = scenes.dancer(20)
    bpy.context.scene.neuralocks.armature, bpy.context.scene.neuralocks.hair = rig, strands
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    strands.neuralocks_hair.model = "/nowhere/model.neuralocks"
    bpy.ops.ed.undo_push(message="chosen")
    strands.neuralocks_hair.live = True
    bpy.ops.ed.undo_push(message="live")
    assert "no such model file" in messages()["Hair"]
    for step, told in ((bpy.ops.ed.undo, set()), (bpy.ops.ed.redo, {"Hair"})):
        step()
        bpy.context.view_layer.update()
        assert set(messages()) == told, (step, messages())


def applied_and_undone(_folder: Path) -> None:
    """What is applied to the points of live hair is applied to its rest shape at once, because Live may be switched off next; and
    again if an undo goes back to the state before the add-on did that, by several steps, too.
    """
    from dcc_addon.handlers import on_update
    from dcc_addon.scene.hair import curves
    from dcc_addon.session import session

    if bpy.app.version < (4, 0):
        raise SkipTest("without a window, older ones keep no undo steps")

    def rest():
        hair = bpy.data.objects["Hair"]
        return transformed(curves.points(hair.data), np.array(hair.matrix_world))

    rig, strands = scenes.dancer(20)
    strands.rotation_euler, strands.scale = (0.1, 0.3, 0.5), (1.4, 1.4, 1.4)
    make_live(rig, strands)
    shown, groomed = points_at(strands, 9), rest()
    bpy.context.view_layer.objects.active = strands
    strands.select_set(True)
    bpy.ops.ed.undo_push(message="before")
    for change in (
        lambda: bpy.ops.object.transform_apply(location=True, rotation=True, scale=True),
        lambda: bpy.ops.object.origin_set(type="ORIGIN_GEOMETRY"),
    ):
        bpy.app.handlers.depsgraph_update_post.remove(on_update)
        change()
        bpy.ops.ed.undo_push(message="applied")  # Blender does this before it calls handlers
        bpy.app.handlers.depsgraph_update_post.append(on_update)
        strands.update_tag()
        bpy.context.view_layer.update()
        assert apart(rest(), groomed) < 1e-5
    rig.select_set(True)
    bpy.ops.ed.undo_push(message="another step")
    for step in [bpy.ops.ed.undo] * 3 + [bpy.ops.ed.redo] * 3:
        step()
        bpy.context.view_layer.update()
        assert apart(rest(), groomed) < 1e-5, step
    rig, strands = bpy.data.objects["Rig"], bpy.data.objects["Hair"]
    bpy.context.scene.neuralocks.armature = rig
    assert apart(scenes.points(strands), shown) < SAME
    for _ in range(3):
        bpy.ops.ed.undo()
    assert session.rigs["Rig"].stale, "the hair is in its own space again"
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert apart(scenes.points(bpy.data.objects["Hair"]), shown) < SAME
    bpy.data.objects["Hair"].neuralocks_hair.live = False
    bpy.context.view_layer.update()
    assert apart(rest(), groomed) < 1e-5
