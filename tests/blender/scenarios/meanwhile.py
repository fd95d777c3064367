# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist does while longer work goes on, which takes events as ever."""

from pathlib import Path

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
