# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that is prepared by threads while Blender goes on."""

import time
from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import MODEL, apart, make_live, messages, points_at


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
        patch("dcc_addon.live.live_strands.at_once", lambda graph: graph.mode == "RENDER"),
        patch("dcc_addon.interface.properties.by_script", lambda context: False),
    ):
        _in_a_window(strands, shown, groomed)


def _in_a_window(strands, shown, groomed) -> None:
    """Live hair is switched on and off while it is prepared."""
    from dcc_addon.live import preparing, view
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
    view.refresh(bpy.context.scene, wait=True)
    assert not session.preparing and apart(points_at(strands, 9), shown) == 0.0

    own.live = False
    own.live = True
    assert session.preparing
    bpy.data.objects.remove(strands)
    finish()
    assert not messages(), messages()
    bpy.context.view_layer.update()
    assert not session.hairs


def prepared_together(_folder: Path) -> None:
    """Showing one hair may stop the preparation of others, or fail: the rest arrives all the same."""
    from dcc_addon.live import preparing
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
