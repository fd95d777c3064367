# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does while longer work goes on, which takes events as ever."""

import math
import threading
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, choose, make_live, messages, points_at, refused


def touched_meanwhile(folder: Path) -> None:
    """A bake has the look that hair had when the bake began, whatever slider is moved meanwhile; if hair is deleted, it says so."""
    rig = scenes.armature()
    scenes.dance(rig)
    strands, bake = scenes.hair(rig, 20), bpy.ops.neuralocks.bake
    make_live(rig, strands)
    live = points_at(strands, 9)

    def at_frame(number, touch):
        def handler(scene, _graph=None):
            if scene.frame_current == number:
                bpy.app.handlers.frame_change_post.remove(handler)
                touch()

        bpy.app.handlers.frame_change_post.append(handler)

    at_frame(5, lambda: setattr(strands.neuralocks_hair, "motion", 0.2))
    assert bake(filepath=str(folder / "out.usdc")) == {"FINISHED"}
    assert strands.neuralocks_hair.motion != 1.0 and apart(points_at(strands, 9), live) > 1e-3
    assert apart(baked_points(folder / "out.usdc", "/Character/Hair_Hair", 9), live) < SAME
    assert not messages(), messages()

    strands.neuralocks_hair.live = False
    at_frame(5, lambda: bpy.data.objects.remove(strands))
    refused(lambda: bake(filepath=str(folder / "gone.usdc")), "deleted or renamed")


def written_meanwhile(folder: Path) -> None:
    """Blender takes events while the shot of a bake is written, which takes seconds if it is long; what is deleted then is in it."""
    from dcc_addon.operators.bake import bake_steps
    from usd.assets import scene_writer

    rig, held = scenes.armature(), threading.Event()
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    make_live(rig, strands)
    live, write = points_at(strands, 9), scene_writer.write_scene

    def write_later(path, arrays):
        assert held.wait(5)
        return write(path, arrays)

    with patch.object(scene_writer, "write_scene", write_later):
        steps = bake_steps(bpy.context, rig, [strands], str(folder / "out.usdc"))
        assert any("Writing" in message for _, _, message in steps)
        bpy.data.objects.remove(strands)
        held.set()
        assert any("Baking" in message for _, _, message in steps)
        for _ in steps:
            pass
    assert apart(baked_points(folder / "out.usdc", "/Character/Hair_Hair", 9), live) < SAME


@patch("dcc_addon.operators.base.SAMPLED", 0.0)
def disabled_meanwhile(folder: Path) -> None:
    """The add-on is disabled while a bake is running: the bake ends, and after enabling the add-on again everything works."""
    import dcc_addon
    from dcc_addon.operators.bake import bake_steps
    from dcc_addon.session import session

    rig = scenes.armature()
    scenes.dance(rig)
    make_live(rig, scenes.hair(rig, 20))
    bpy.context.scene.frame_set(9)
    _begun(bake_steps(bpy.context, rig, [bpy.data.objects["Hair"]], str(folder / "bake.usdc")))
    assert session.working
    dcc_addon.unregister()
    assert not session.paused and not session.working and bpy.context.scene.frame_current == 9
    dcc_addon.register()
    rig, strands = bpy.data.objects["Rig"], bpy.data.objects["Hair"]
    make_live(rig, strands)
    assert apart(points_at(strands, 9), points_at(strands, 14)) > 1e-3 and not messages(), messages()


@patch("dcc_addon.operators.base.SAMPLED", 0.0)
def edited_meanwhile(folder: Path) -> None:
    """While a bake samples, the artist's frame is shown, a slider acts at once, and an unkeyed bone that is turned stays so; the
    motion is out of date afterwards. Frames are those of the scene that the bake began in, whichever is shown by then.
    """
    from dcc_addon.operators.bake import bake_steps
    from dcc_addon.scene.hair import curves
    from dcc_addon.scene.motion import up_to_date
    from dcc_addon.session import session

    rig, strands = scenes.dancer(20)
    scene = bpy.context.scene
    make_live(rig, strands)
    scene.frame_set(9)

    def begun():
        session.rigs["Rig"].stale = False
        return _begun(bake_steps(bpy.context, rig, [strands], str(folder / "bake.usdc")))

    before, work = curves.shown(strands.data), begun()
    assert scene.frame_current == 9 and not session.paused
    strands.neuralocks_hair.motion = 0.2
    followed = curves.shown(strands.data)
    assert apart(followed, before) > 1e-3
    _ended(work)
    assert apart(curves.shown(strands.data), followed) == 0.0 and not session.rigs["Rig"].stale

    work, arm = begun(), rig.pose.bones["upper_arm.R"]
    arm.rotation_euler.z = 0.4
    bpy.context.view_layer.update()
    _ended(work)
    up_to_date.notice(rig, scene)
    assert abs(arm.rotation_euler.z - 0.4) < 1e-6 and session.rigs["Rig"].stale

    work, head = begun(), rig.pose.bones["head"]
    head.rotation_euler.y += 0.5
    head.keyframe_insert("rotation_euler", frame=9)
    bpy.context.view_layer.update()
    _ended(work)
    assert session.rigs["Rig"].stale

    other, work = bpy.data.scenes.new("Other"), begun()
    bpy.context.window.scene = other
    _ended(work)
    assert scene.frame_current == 9 and other.frame_current == 1 and not messages(), messages()


def simulated_in_slices(_folder: Path) -> None:
    """A rigid body falls through all frames, although the artist's frame is shown between them."""
    from dcc_addon.scene.motion.sampling import in_slices
    from dcc_addon.session import session

    drawn = []
    for seconds in (math.inf, 0.0):
        scenes.empty()
        rig = scenes.armature()
        scenes.dance(rig)
        body = scenes.body(rig)
        body.modifiers.clear()
        body.parent = None
        bpy.ops.rigidbody.world_add()
        choose(body)
        bpy.ops.rigidbody.object_add()
        rig.pose.bones["neck"].constraints.new("COPY_LOCATION").target = body
        list(in_slices(bpy.context, rig, seconds))
        drawn.append(session.rigs["Rig"].drawn[:, rig.data.bones.find("head"), 2, 3])
    assert np.ptp(drawn[0]) > 1.0 and apart(*drawn) == 0.0


@patch("dcc_addon.scene.character.body.WEIGHED", 10)
def weighed_in_steps(_folder: Path) -> None:
    """The weights of a large body are read in several slices, before the first frame; if edited meanwhile, they are read again."""
    from dcc_addon.scene.character import body
    from dcc_addon.scene.motion.sampling import in_slices
    from dcc_addon.session import session

    scenes.empty()
    rig = scenes.armature()
    scenes.dance(rig)
    skin = scenes.body(rig)
    count = len(skin.data.vertices)

    def first_frame(edit) -> int:
        """Slices before the first frame is read."""
        slices = in_slices(bpy.context, rig, 0.0)
        done = [next(slices)[0] for _ in range(3)]
        edit()
        done += [now for now, _ in slices]
        return done.index(1)

    assert first_frame(lambda: None) > count / 10 - 2, count
    known = session.read.weights[skin.data.name_full][1]
    np.testing.assert_array_equal(known, body.read(skin, rig).weights)
    assert first_frame(lambda: None) == 1  # what is known is not read again

    def reweigh() -> None:
        skin.vertex_groups[0].add([0], 0.25, "REPLACE")
        session.edits += 1
        session.read.weights.clear()

    session.read.weights.clear()
    first_frame(reweigh)
    assert 0.25 in body.read(skin, rig).weights[:, 2]


@patch("dcc_addon.background.SLICE", 0.0)
def posed_without_a_key(_folder: Path) -> None:
    """A shape key value that was changed but not keyed yet is restored after each slice, which does not count as an edit that
    restarts sampling.
    """
    from dcc_addon import background
    from dcc_addon.session import session

    rig = scenes.armature()
    scenes.dance(rig)
    skin = scenes.body(rig)
    skin.shape_key_add(name="Basis")
    wide = skin.shape_key_add(name="wide")
    for frame in (1, 24):
        wide.value = frame / 24
        wide.keyframe_insert("value", frame=frame)
    make_live(rig, scenes.hair(rig, 10))
    bpy.context.scene.frame_set(9)
    wide.value = 0.9
    bpy.context.view_layer.update()
    session.rigs["Rig"].stale = True
    for _ in range(60):
        if background.look() is None:
            break
        bpy.context.view_layer.update()
    assert not session.rigs["Rig"].stale and session.sampling.done is None and abs(wide.value - 0.9) < 1e-6


def _begun(steps):
    """The work of an operator, started as in a window."""
    from dcc_addon.operators import base
    from dcc_addon.session import session
    from neuralocks_core.time_left import TimeLeft

    class Work(base.Stepwise):
        bl_label = "Work"

        def report(self, kind, text):
            assert "ERROR" not in kind, text

    work, manager = Work(), bpy.context.window_manager
    work._timer, work._steps = manager.event_timer_add(0.01, window=bpy.context.window), steps
    work._left = TimeLeft()
    session.working = work.bl_label
    base._running[:] = [work]
    while next(steps)[2] == "Loading USD":
        pass
    return work


def _ended(work) -> None:
    """Tick until it is done."""
    shown = SimpleNamespace(status_text_set=lambda text: None)
    while work.modal(
        SimpleNamespace(window_manager=bpy.context.window_manager, workspace=shown, scene=bpy.context.scene),
        SimpleNamespace(type="TIMER"),
    ) == {"RUNNING_MODAL"}:
        pass
