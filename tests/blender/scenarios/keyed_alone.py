# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked keys of hair bones that are all the animation that a character has of its own."""

import math
from pathlib import Path

import bpy

from tests.blender import scenes
from tests.blender.checks import SAME, apart, bones_at, give_bone_model, messages

FRAMES = (3, 11, 20)


def keyed_on_a_ride(folder: Path) -> None:
    """The keys of a character that rides on something still play after its motion is sampled, which is done without them."""
    rig, scene = scenes.armature(bones=scenes.BONES + scenes.TAIL), bpy.context.scene
    cart = bpy.data.objects.new("Cart", None)
    scene.collection.objects.link(cart)
    rig.parent = cart
    for frame in range(1, 25, 3):
        cart.location.y = 0.3 * math.sin(frame)
        cart.keyframe_insert("location", frame=frame)
    give_bone_model(rig, folder)

    def turns() -> list:
        return [bones_at(rig, frame, ["hair.02"]) for frame in FRAMES]

    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    keyed = turns()
    assert apart(keyed[0], keyed[-1]) > 0.01
    for _ in range(2):
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        gap = max(apart(*pair) for pair in zip(turns(), keyed, strict=True))
        assert gap < SAME, gap
    assert not messages(), messages()
