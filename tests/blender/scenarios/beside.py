# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes on beside Blender: sampling in the background, hair prepared by threads, work that is cancelled."""

import time
from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import MODEL, apart, make_live, messages, points_at, refused


def prepared_once(_folder: Path) -> None:
    """An edit of one character's animation does not prepare any hair again, its own or others'; an edit of its body, or another
    armature for the hair, does.
    """
    from dcc_addon.session import session

    first, second = scenes.armature("Anna"), scenes.armature("Ben")
    scenes.dance(first)
    scenes.dance(second)
    skin = scenes.body(first)
    one, two = scenes.hair(first, 20, name="One"), scenes.hair(second, 30, name="Two")
    make_live(first, one)
    make_live(second, two)
    before = points_at(one, 12)
    prepared = dict(session.hairs)
    assert set(prepared) == {"One", "Two"}
    one_resolver = prepared["One"].hair._resolver

    def sample():
        bpy.context.scene.neuralocks.armature = first
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}

    def fresh(hair):
        """Points of hair that is prepared anew."""
        session.hairs.clear()
        return points_at(hair, 12)

    first.pose.bones["head"].rotation_euler[1] += 0.5
    first.pose.bones["head"].keyframe_insert("rotation_euler", frame=9)
    sample()
    edited = points_at(one, 12)
    assert (
        all(session.hairs[name].hair is each.hair for name, each in prepared.items()) and apart(edited, before) > 0.01
    )
    assert one_resolver is session.hairs["One"].hair._resolver, "the same skin stands still"
    assert apart(fresh(one), edited) == 0.0
    points_at(two, 12)
    prepared = dict(session.hairs)

    for vertex in skin.data.vertices:
        vertex.co.x *= 1.3
    sample()
    wide = points_at(one, 12)
    assert session.hairs["Two"].hair is prepared["Two"].hair and session.hairs["One"].hair is not prepared["One"].hair
    assert apart(fresh(one), wide) == 0.0

    prepared = session.hairs["One"].hair
    one.location.y += 0.05  # the same character, but other hair on it
    sample()
    there = points_at(one, 12)
    assert session.hairs["One"].hair is not prepared and apart(fresh(one), there) == 0.0

    one.neuralocks_hair.armature = one.parent = second
    bpy.context.scene.neuralocks.armature = second
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    moved = points_at(one, 12)
    assert apart(moved, there) > 0.001 and apart(fresh(one), moved) == 0.0
    assert not messages(), messages()


def prepared_beside(_folder: Path) -> None:
    """In a window, a thread prepares the hair: it is at rest until then, and as usual afterwards; Live cancels; a render waits;
    nothing is left of hair that is deleted meanwhile.
    """
    rig, strands = scenes.dancer(1500)
    make_live(rig, strands)
    shown = points_at(strands, 9)
    strands.neuralocks_hair.live = False
    groomed = points_at(strands, 9)
    with (
        patch("dcc_addon.live_strands.at_once", lambda graph: graph.mode == "RENDER"),
        patch("dcc_addon.properties.by_script", lambda context: False),
    ):
        _in_a_window(strands, shown, groomed)


def _in_a_window(strands, shown, groomed) -> None:
    """Live hair is switched on and off while it is prepared."""
    from dcc_addon import live, preparing
    from dcc_addon.session import session

    own = strands.neuralocks_hair

    def finish():
        while preparing.look() is not None:
            time.sleep(0.01)
        assert not session.preparing

    own.live = True
    assert session.preparing and apart(scenes.points(strands), groomed) == 0.0
    points_at(strands, 12)
    assert apart(points_at(strands, 9), groomed) == 0.0
    finish()
    assert apart(scenes.points(strands), shown) == 0.0 and not messages(), messages()

    own.live = False
    own.live = True
    assert session.preparing
    own.live = False
    finish()
    assert not session.hairs and apart(scenes.points(strands), groomed) == 0.0

    own.model = "/nowhere.neuralocks"
    own.live = True
    finish()
    assert "no such" in messages()["Hair"], messages()
    own.model = MODEL
    assert session.preparing
    live.refresh(bpy.context.scene, wait=True)
    assert not session.preparing and apart(points_at(strands, 9), shown) == 0.0

    own.live = False
    own.live = True
    assert session.preparing
    bpy.data.objects.remove(strands)
    finish()
    assert not messages(), messages()
    bpy.context.view_layer.update()
    assert not session.hairs


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


def prepared_together(_folder: Path) -> None:
    """Showing one hair may stop the preparation of others, or fail: the rest arrives all the same."""
    import dcc_addon.preparing as preparing
    from dcc_addon.session import session

    arrived = []

    def wait():
        while preparing.look() is not None:
            time.sleep(0.01)

    def stop_the_second(name):
        arrived.append(name)
        session.stop_preparing("Two")

    def fail(name):
        arrived.append(name)
        raise KeyError(name)

    for name, then in (("One", stop_the_second), ("Two", arrived.append), ("Three", fail), ("Four", arrived.append)):
        preparing.start(name, lambda say, name=name: name.lower(), then)
    while any(job.running for job, _ in session.preparing.values()):
        time.sleep(0.01)
    wait()
    assert arrived == ["One", "Three", "Four"], arrived
    assert session.hairs == {"One": "one", "Three": "three", "Four": "four"}, session.hairs
    assert "KeyError" in messages()["Three"] and not session.preparing


@patch("dcc_addon.background.SLICE", 0.0)
def sampled_beside(_folder: Path) -> None:
    """Sampling in the background ends whatever goes wrong, says what, and tries again when the rig is fixed."""
    from dcc_addon import background
    from dcc_addon.scene import sampling
    from dcc_addon.session import session

    rig, strands = scenes.dancer(20)
    make_live(rig, strands)
    shown, motion = points_at(strands, 9), session.rigs["Rig"].motion

    def sample():
        session.rigs["Rig"].stale = True
        while background.look() is not None:
            pass
        assert session.sampling is None

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
    assert "KeyError" in messages()["Rig"] and session.failed == {"Rig"}
    sample()
    assert session.rigs["Rig"].stale, "what has failed is not tried again and again"

    rig.scale = (-1, 1, 1)
    bpy.context.view_layer.update()
    assert not session.failed
    sample()
    assert "mirrored" in messages()["Rig"] and session.failed == {"Rig"}
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
    assert session.sampling == 0.0
    with patch.object(session, "working", "Bake to USD"):
        assert background.look() == background.PAUSE and session.sampling == 0.0, "it steps frames beside an operator"
    background.look()
    assert session.sampling > 0.0
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    assert background.look() is None and session.sampling is None, "nobody looks at what was sampled"
    bpy.context.window.scene = scene
    sample()
    assert not messages() and not session.rigs["Rig"].stale, messages()
