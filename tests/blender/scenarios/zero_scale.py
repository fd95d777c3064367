# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scale of zero hides: a prop, a bone that moves hair, a whole character."""

from pathlib import Path

import bpy

from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, points_at, refused


def hidden_prop(folder: Path) -> None:
    """A prop hidden by a scale of zero does not prevent a bake; a hidden bone that moves hair gets a message."""
    prop = [*scenes.BONES, ("prop", "forearm.L", (0.5, 0, 1.2), (0.6, 0, 1.2))]
    rig, scene = scenes.armature(bones=prop), bpy.context.scene
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig, 20)
    bone = rig.pose.bones["prop"]
    for frame, size in ((8, (1, 1, 1)), (12, (0, 0, 0)), (16, (1, 1, 0))):
        bone.scale = size
        bone.keyframe_insert("scale", frame=frame)
    make_live(rig, strands)
    view = points_at(strands, 14)
    baked = folder / "out.usdc"
    assert bpy.ops.neuralocks.bake(filepath=str(baked)) == {"FINISHED"}
    assert apart(view, baked_points(baked, "/Character/Hair_Hair", 14)) < SAME

    head = rig.pose.bones["head"]
    for frame, size in ((5, 1), (6, 0)):
        head.scale = [size] * 3
        head.keyframe_insert("scale", frame=frame)
    scene.frame_set(3)
    refused(bpy.ops.neuralocks.sample_motion, "bone 'head'", "zero scale in frame 6")


def hidden_armature(folder: Path) -> None:
    """For a character hidden by the scale of its armature, or of a parent, the message says so, and does not blame a bone."""
    rig, strands = scenes.dancer(20, skinned=True)
    scene = bpy.context.scene
    make_live(rig, strands)
    holder = bpy.data.objects.new("Holder", None)
    scene.collection.objects.link(holder)
    rig.parent = holder
    for frame, size, said in (
        (5, 1, ""),
        (6, 0, "Rig: it has zero scale in frame 6"),
        (1, 0, "Rig: it has zero scale in frame 1"),
    ):
        holder.scale = [size] * 3
        holder.keyframe_insert("scale", frame=frame)
        if said:
            scene.frame_set(5)
            refused(bpy.ops.neuralocks.sample_motion, said)
