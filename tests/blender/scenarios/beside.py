# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes on beside Blender: sampling in the background, and work that is cancelled."""

from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import MODEL, apart, make_live, messages, points_at, refused


@patch.multiple("dcc_addon.operators.base", SAMPLED=0.0, _running=["as in a window"])
def loaded_meanwhile(folder: Path) -> None:
    """Another file is opened while a bake samples, or Blender ends a bake that the panel shows: live hair continues."""
    from types import SimpleNamespace

    from dcc_addon.operators.bake import bake_steps
    from dcc_addon.operators.base import Stepwise
    from dcc_addon.session import session

    rig, strands = scenes.dancer(20)
    make_live(rig, strands)
    shown = points_at(strands, 9)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))

    def begun():
        steps = bake_steps(bpy.context, rig, [strands], str(folder / "bake.usdc"))
        while "Sampling" not in next(steps)[2]:
            pass
        next(steps)
        return steps

    steps = begun()
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    try:
        steps.close()
    except ReferenceError:
        pass
    assert session.paused == 0, session.paused
    rig, strands = bpy.data.objects["Rig"], bpy.data.objects["Hair"]
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert apart(points_at(strands, 9), shown) == 0.0

    ended = []
    manager = SimpleNamespace(event_timer_remove=ended.append, progress_end=lambda: ended.append("progress"))
    running = Stepwise()
    running._timer, running._steps = "timer", begun()
    running.cancel(SimpleNamespace(window_manager=manager, workspace=None))
    assert session.paused == 0 and ended == ["timer", "progress"]
    assert apart(points_at(strands, 9), shown) == 0.0


def cancelled(folder: Path) -> None:
    """A bake that is cancelled or refused leaves nothing, and what an earlier one wrote stays as it was."""
    from dcc_addon.operators.bake import bake_steps

    rig = scenes.armature()
    scenes.dance(rig)
    one, two = scenes.hair(rig, 20, name="One"), scenes.hair(rig, 20, name="Two")
    one.neuralocks_hair.model = two.neuralocks_hair.model = MODEL
    two.neuralocks_hair.bend = 2.0
    bpy.context.scene.neuralocks.armature, out = rig, str(folder / "new" / "bake.usdc")

    def files():
        return {path.name: path.is_file() and path.read_bytes() for path in folder.rglob("*")}

    def cancel(hairs, at):
        steps = bake_steps(bpy.context, rig, hairs, out)
        while (step := next(steps))[0] / step[1] < at or "Baking" not in step[2]:
            pass
        # By names alone: what the bake writes beside it may be gone before it is read.
        assert any("shot" in path.name for path in folder.rglob("*"))
        steps.close()

    def refuse():
        two.neuralocks_hair.model = "/nowhere.neuralocks"
        refused(lambda: bpy.ops.neuralocks.bake(filepath=out), "no such")
        two.neuralocks_hair.model = MODEL

    for earlier in (False, True):
        if earlier:
            assert bpy.ops.neuralocks.bake(filepath=out) == {"FINISHED"}
            bpy.context.scene.frame_end += 1  # the next ones differ
        before = files()
        assert bool(before) == earlier
        for stop in (lambda: cancel([one], 0.5), lambda: cancel([one, two], 0.75), refuse):
            stop()
            now = files()
            assert sorted(now) == sorted(before) and now == before, sorted(now)


@patch("dcc_addon.background.SLICE", 0.0)
def sampled_beside(_folder: Path) -> None:
    """Sampling in the background ends whatever goes wrong, says what, and tries again when the rig is fixed."""
    from dcc_addon import background
    from dcc_addon.scene.motion import sampling
    from dcc_addon.session import session

    rig, strands = scenes.dancer(20)
    make_live(rig, strands)
    shown, motion = points_at(strands, 9), session.rigs["Rig"].motion

    def sample():
        session.rigs["Rig"].stale = True
        while background.look() is not None:
            pass
        assert session.sampling.done is None

    def broken(_context, _armature, _seconds):
        yield 1, 2
        raise KeyError("a bone")

    for many in (3, 5 * len(rig.pose.bones)):
        with patch.object(sampling, "MANY", many):
            sample()
        again = session.rigs["Rig"].motion
        assert again is not motion and apart(again.world(), motion.world()) < 1e-12, "in blocks of some frames"
    with patch.object(background, "in_slices", broken):
        sample()
    assert "KeyError" in messages()["Rig"] and session.sampling.failed == {"Rig"}
    sample()
    assert session.rigs["Rig"].stale, "what has failed is not tried again and again"

    rig.scale = (-1, 1, 1)
    bpy.context.view_layer.update()
    assert not session.sampling.failed
    sample()
    assert "mirrored" in messages()["Rig"] and session.sampling.failed == {"Rig"}
    rig.scale = (1, 1, 1)
    bpy.context.view_layer.update()
    sample()
    assert not messages() and not session.rigs["Rig"].stale, messages()
    assert apart(points_at(strands, 9), shown) == 0.0

    if bpy.app.version >= (4, 0):  # without a window, older ones keep no undo steps
        for frame in (4, 5):
            bpy.context.scene.frame_set(frame)
            bpy.ops.ed.undo_push(message="another frame")
        session.rigs["Rig"].stale = True
        background.look()
        bpy.ops.ed.undo()
        sample()
        assert not messages() and not session.rigs["Rig"].stale, messages()

    session.rigs["Rig"].stale, scene = True, bpy.context.scene
    background.look()
    assert session.sampling.done == 0.0
    with patch.object(session, "working", "Bake to USD"):
        assert background.look() == background.PAUSE and session.sampling.done == 0.0, (
            "it steps frames beside an operator"
        )
    background.look()
    assert session.sampling.done > 0.0
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    assert background.look() is None and session.sampling.done is None, "nobody looks at what was sampled"
    bpy.context.window.scene = scene
    sample()
    assert not messages() and not session.rigs["Rig"].stale, messages()
