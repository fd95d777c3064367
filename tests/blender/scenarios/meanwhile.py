# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does while longer work goes on, which takes events as ever."""

from pathlib import Path
from types import SimpleNamespace

import bpy

from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, messages, points_at, refused


def touched_meanwhile(folder: Path) -> None:
    """A bake has the look that hair had when it began, whatever slider is moved meanwhile; of hair that is deleted it says
    so.
    """
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


def disabled_meanwhile(folder: Path) -> None:
    """The add-on is disabled while a bake is at work: it ends, and enabled anew all works."""
    import dcc_addon
    from dcc_addon.operators.bake import bake_steps
    from dcc_addon.session import session

    rig = scenes.armature()
    scenes.dance(rig)
    make_live(rig, scenes.hair(rig, 20))
    bpy.context.scene.frame_set(9)
    _begun(bake_steps(bpy.context, rig, [bpy.data.objects["Hair"]], str(folder / "bake.usdc")))
    assert session.paused and session.working
    dcc_addon.unregister()
    assert not session.paused and not session.working and bpy.context.scene.frame_current == 9
    dcc_addon.register()
    rig, strands = bpy.data.objects["Rig"], bpy.data.objects["Hair"]
    make_live(rig, strands)
    assert apart(points_at(strands, 9), points_at(strands, 14)) > 1e-3 and not messages(), messages()


def slider_meanwhile(folder: Path) -> None:
    """A slider that is moved while a bake samples is followed when it has ended; frames are those of the scene that it
    began in, whichever is shown by then.
    """
    from dcc_addon.operators.bake import bake_steps
    from dcc_addon.scene import curves
    from dcc_addon.session import session

    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    make_live(rig, strands)
    scene.frame_set(9)
    before = curves.shown(strands.data)
    work = _begun(bake_steps(bpy.context, rig, [strands], str(folder / "bake.usdc")))
    assert session.paused
    strands.neuralocks_hair.motion = 0.2
    assert apart(curves.shown(strands.data), before) == 0.0
    _ended(work)
    after = scenes.points(strands)
    assert apart(curves.shown(strands.data), before) > 1e-3 and apart(after, points_at(strands, 9)) == 0.0

    other = bpy.data.scenes.new("Other")
    work = _begun(_numbered(scene))
    work.steps_frames = True
    scene.frame_set(9)
    bpy.context.window.scene = other
    _ended(work)
    assert scene.frame_current == 9 and other.frame_current == 1


def _numbered(scene):
    """Work that leaves the scene at another frame with each step."""
    for frame in range(10, 15):
        scene.frame_set(frame)
        yield frame, 15, "Counting"


def _begun(steps):
    """The work of an operator, begun as in a window."""
    from dcc_addon.operators import base
    from dcc_addon.session import session

    class Work(base.Stepwise):
        bl_label = "Work"

        def report(self, kind, text):
            assert "ERROR" not in kind, text

    work, manager = Work(), bpy.context.window_manager
    work._timer, work._steps = manager.event_timer_add(0.01, window=bpy.context.window), steps
    work._scene, session.working = bpy.context.scene, work.bl_label
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
