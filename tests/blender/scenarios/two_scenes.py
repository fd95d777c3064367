# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair in two scenes that are shown at once, or by turns."""

import time
from pathlib import Path
from unittest.mock import patch

import bpy

from tests.blender import scenes
from tests.blender.checks import apart, make_live, messages, points_at


@patch("dcc_addon.background.SLICE", 0.0)
def two_windows(_folder: Path) -> None:
    """Windows show two scenes: the characters of both are sampled in the background, one that is in both only once."""
    from dcc_addon import background
    from dcc_addon.scene.hair import curves
    from dcc_addon.session import session

    first, rig, strands = _dancing("Rig")
    shown = points_at(strands, 9)
    second = bpy.context.window.scene = bpy.data.scenes.new("Second")
    _, other, hair = _dancing("Other")
    second.collection.objects.link(rig)
    second.collection.objects.link(strands)
    second.frame_end = 12  # another range: what is in both is never sampled for both
    second.frame_set(9)
    bpy.context.window.scene = first
    for name in ("Rig", "Other"):
        session.forget_motion(name)
    with patch.object(background, "scenes_shown", lambda: [first, second]):
        looks = 0
        while background.look() is not None:
            looks += 1
            assert looks < 200, "what one scene wants undoes what the other has"
    assert len(session.rigs["Rig"].motion.frames) == 24 and len(session.rigs["Other"].motion.frames) == 12
    assert not messages() and not session.rigs["Other"].stale, messages()
    assert apart(points_at(strands, 9), shown) < 1e-6
    assert second.frame_current == 9 and apart(curves.shown(hair.data), curves.points(hair.data)) > 1e-3


@patch("dcc_addon.live.live_strands.at_once", lambda graph: False)
def arrived_elsewhere(_folder: Path) -> None:
    """Hair is prepared while another scene comes into view: it moves when its own scene is shown again, without errors."""
    from dcc_addon.live import preparing
    from dcc_addon.scene.hair import curves
    from dcc_addon.session import session

    scene, _, strands = _dancing("Rig")
    scene.frame_set(9)
    shown = curves.shown(strands.data)
    session.forget(strands.name_full)
    scene.frame_set(8)
    scene.frame_set(9)
    assert strands.name_full in session.preparing
    bpy.context.window.scene = bpy.data.scenes.new("Second")
    while preparing.look() is not None:
        time.sleep(0.01)
    assert not messages(), messages()
    bpy.context.window.scene = scene
    assert apart(curves.shown(strands.data), shown) < 1e-6


def _dancing(name: str):
    """A scene in view with a dancing character and live hair."""
    rig, scene = scenes.armature(name), bpy.context.scene
    scenes.dance(rig)
    strands = scenes.hair(rig, 20, name=f"Hair {name}")
    make_live(rig, strands)
    return scene, rig, strands
