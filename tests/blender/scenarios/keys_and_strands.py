# SPDX-License-Identifier: GPL-3.0-or-later
"""Strands of a character whose hair bones have baked keys, or are live."""

from pathlib import Path

import bpy

from tests.blender import scenes
from tests.blender.checks import (
    SAME,
    apart,
    baked_points,
    give_bone_model,
    make_live,
    messages,
    needs_usd,
    points_at,
    refused,
    told_by,
)


def strands_beside_keyed_bones(folder: Path) -> None:
    """Strands of a character with baked hair bones are the same as without them, or with live ones, shown and baked, whether the
    track is muted or not; a solo track plays alone, also for strands.
    """
    from dcc_addon.scene.motion.up_to_date import notice
    from dcc_addon.session import session

    needs_usd()
    rig, scene = scenes.armature(bones=scenes.BONES + scenes.TAIL), bpy.context.scene
    scene.frame_end = 9
    scenes.body(rig)
    scenes.dance(rig)
    strands, out = scenes.hair(rig, 40, length=0.4), folder / "out.usdc"
    make_live(rig, strands, resolve=True)
    expected = {frame: points_at(strands, frame) for frame in (3, 6, 9)}

    def as_baked() -> None:
        assert bpy.ops.neuralocks.bake(filepath=str(out)) == {"FINISHED"}
        for frame, points in expected.items():
            assert apart(baked_points(out, "/Character/Hair_Hair", frame), points) < SAME

    def same() -> None:
        for frame, points in expected.items():
            assert apart(points_at(strands, frame), points) == 0.0
        as_baked()
        for frame, points in expected.items():
            assert apart(points_at(strands, frame), points) == 0.0
        notice(rig, scene)
        assert not session.rigs["Rig"].stale and not messages(), messages()

    rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
    rig.neuralocks_character.rig_live = True
    same()
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    same()
    track = rig.animation_data.nla_tracks["Neuralocks Hair"]
    for muted in (True, False):
        track.mute = muted
        same()
    track.is_solo = True
    notice(rig, scene)
    assert session.rigs["Rig"].stale
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    expected = {frame: points_at(strands, frame) for frame in expected}
    assert not session.rigs["Rig"].stale and track.is_solo
    as_baked()
    track.is_solo = False
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}


def strands_on_a_hair_bone(folder: Path) -> None:
    """Strands whose object moves with a hair bone, or with a child of one, are refused by Live and by caches while that bone is live or
    its keys play, and a bake has a note: Blender would move them with the bone, and a bake does not.
    """
    from dcc_addon.interface.hair_notes import hair_notes

    needs_usd()
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    strands, own = scenes.hair(rig, 20), rig.neuralocks_character
    strands.parent_type, strands.parent_bone = "BONE", "hair.02"
    bpy.context.view_layer.update()
    strands.matrix_world = scenes.translation((0, 0, 0))
    give_bone_model(rig, folder)
    make_live(rig, strands)
    bpy.context.scene.neuralocks.output = str(folder / "out.usdc")
    expected, out, why = points_at(strands, 9), folder / "out.usdc", "moves with hair bone 'hair.01'"

    def alike() -> None:
        assert apart(points_at(strands, 9), expected) < SAME and not messages(), messages()

    def at_odds() -> None:
        points_at(strands, 8)
        points_at(strands, 9)
        assert why in messages()["Hair"] and "child of the head bone" in messages()["Hair"], messages()
        refused(bpy.ops.neuralocks.bake_attach, why)
        assert [line for line in told_by(bpy.ops.neuralocks.bake) if why in line]
        assert apart(baked_points(out, "/Character/Hair_Hair", 9), expected) < SAME

    alike()
    own.rig_live = True
    at_odds()
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    at_odds()
    track = rig.animation_data.nla_tracks["Neuralocks Hair"]
    track.mute = True
    alike()
    assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
    assert apart(points_at(strands, 9), expected) < SAME and not [
        note for note in hair_notes(strands, bpy.context.scene) if why in note
    ]
    track.mute = False
    assert [note for note in hair_notes(strands, bpy.context.scene) if why in note]
