# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair bones that are moved by more than hair: what keeps baked keys from being heard, and what does not."""

from pathlib import Path

import bpy

from dcc_addon.scene.keys import rotations
from tests.blender import scenes
from tests.blender.checks import SAME, apart, bones_at, choose, give_bone_model, messages, refused


def turned_otherwise(folder: Path) -> None:
    """Hair bones that something else also turns are refused, by Live and by bakes, and so are keys that would have no effect; if
    time is stretched, keys play as the live view does.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.body(rig)
    scenes.dance(rig)
    scene, bone = bpy.context.scene, rig.pose.bones["hair.01"]
    give_bone_model(rig, folder)

    limit = bone.constraints.new("LIMIT_ROTATION")
    rig.neuralocks_character.rig_live = True
    scene.frame_set(5)
    assert "'Limit Rotation'" in messages()["Rig"]
    refused(bpy.ops.neuralocks.bake_keys, "hair.01", "mute the constraint")
    limit.mute, bone.bone.use_inherit_rotation = True, False
    refused(bpy.ops.neuralocks.bake_keys, "hair.01", "Inherit Rotation")
    bone.bone.use_inherit_rotation = True
    limit.mute = False
    for setting, values in (("influence", (0.0, 1.0)), ("mute", (True, False))):  # off in the frame that is shown
        for frame, value in zip((11, 12), values):
            setattr(limit, setting, value)
            limit.keyframe_insert(setting, frame=frame)
        scene.frame_set(5)
        refused(bpy.ops.neuralocks.bake_keys, "hair.01", "'Limit Rotation'", "mute")
        limit.mute = True
        if setting == "influence":
            assert bpy.ops.neuralocks.bake_keys() == bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    bone.constraints.remove(limit)
    rig.animation_data.use_nla = False
    refused(bpy.ops.neuralocks.bake_keys, "NLA is switched off")
    rig.animation_data.use_nla = True
    assert bone.keyframe_insert("rotation_mode", frame=1)
    refused(bpy.ops.neuralocks.bake_keys, "hair.01", "rotation mode", "delete")
    assert bone.keyframe_delete("rotation_mode", frame=1)
    _edit_a_strip(rig)
    refused(bpy.ops.neuralocks.bake_keys, "tweak mode", "leave it")
    rig.animation_data.use_tweak_mode = False

    for old, new in ((100, 50), (100, 200)):
        scene.render.frame_map_old, scene.render.frame_map_new = old, new
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        rig.neuralocks_character.rig_live = True
        live = {frame: bones_at(rig, frame) for frame in (1, 4, 11)}
        assert not messages(), messages()
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
        for frame, expected in live.items():
            assert apart(bones_at(rig, frame), expected) < SAME, (new, frame)
        assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}


def _edit_a_strip(rig) -> None:
    """Put the action on a strip, another one above it, and go into tweak mode."""
    data = rig.animation_data
    track, above = data.nla_tracks.new(), bpy.data.actions.new("Above")
    strip = track.strips.new("Dance", 1, data.action)
    data.action, strip.select, data.nla_tracks.active = above, True, track
    data.use_tweak_mode = True
    assert data.use_tweak_mode and data.action != above


def keys_that_do_not_play(folder: Path) -> None:
    """Keys in every rotation mode prevent a bake of hair bones only if they play: not those of muted curves and groups, nor those
    of other things that the same action moves.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    give_bone_model(rig, folder)
    channels = ("rotation_quaternion", "rotation_euler", "rotation_axis_angle")
    for channel in channels:
        rig.pose.bones["hair.01"].keyframe_insert(channel, frame=1, group=channel)

    def refuses() -> None:
        refused(bpy.ops.neuralocks.bake_keys, "hair.01", "every rotation mode")

    def bakes() -> None:
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"} and bpy.ops.neuralocks.remove_keys() == {"FINISHED"}

    curves = {curve.group.name: curve for curve in scenes.fcurves(rig) if "hair.01" in curve.data_path}
    assert set(curves) == set(channels)
    refuses()
    of_channel = [curve for curve in scenes.fcurves(rig) if curve.data_path == curves[channels[0]].data_path]
    for muted in (True, False):
        for curve in of_channel:
            curve.mute = muted
        bakes() if muted else refuses()
    for muted in (True, False):
        curves[channels[0]].group.mute = muted
        bakes() if muted else refuses()

    action = rig.animation_data.action
    if hasattr(action, "slots"):
        rig.animation_data.action_slot = action.slots.new("OBJECT", "Other")
        bakes()


def action_beside_keys(folder: Path) -> None:
    """An action that plays alone keeps moving the body as before beside baked keys, however its influence, extrapolation and blending
    are set, which Blender overlooks without strips; removing the keys sets it as it was, unless the artist has set it since.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig, (1, 16))
    give_bone_model(rig, folder)
    data, body = rig.animation_data, [name for name, *_ in scenes.BONES]
    names, quiet = ("action_influence", "action_extrapolation", "action_blend_type"), (0.5, "NOTHING", "ADD")
    muted = data.nla_tracks.new()
    muted.strips.new("Other", 1, data.action)
    muted.mute = True

    def put(*values) -> None:
        for name, value in zip(names, values, strict=True):
            setattr(data, name, value)

    def same() -> bool:
        found = {frame: bones_at(rig, frame, body) for frame in still}
        return max(apart(found[frame], still[frame]) for frame in still) < 1e-6

    def is_put(*values) -> bool:
        return tuple(getattr(data, name) for name in names) == values

    put(*quiet)
    still = {frame: bones_at(rig, frame, body) for frame in (2, 9, 22)}
    for _ in range(2):  # the second time in place of the first
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
        assert same()
    for track in list(data.nla_tracks)[1:]:  # by hand
        data.nla_tracks.remove(track)
    for since in ((), (0.25, "HOLD", "REPLACE")):
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
        put(*(since or (1.0, "HOLD", "REPLACE")))
        assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
        assert same() and is_put(*(since or quiet))

    action, data.action = data.action, None
    put(*quiet)
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"} and is_put(1.0, "HOLD", "REPLACE"), (
        "for the artist's next keys"
    )
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"} and is_put(*quiet)
    data.action = action
    put(*since)

    muted.mute = False
    still = {frame: bones_at(rig, frame, body) for frame in still}
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    assert same() and is_put(*since), "it plays beside the artist's own strips as set"
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"} and is_put(*since)


def baked_by_blender(folder: Path) -> None:
    """What Blender's own Bake Action makes of live hair bones keeps playing when Live is off, whether in Euler angles, which it did
    not bake, or not; a bone that also has keys in its own mode gets that mode back.
    """
    rig, scene = scenes.armature(bones=scenes.BONES + scenes.TAIL), bpy.context.scene
    scenes.body(rig)
    scenes.dance(rig)
    own, tail = rig.neuralocks_character, rig.pose.bones["hair.02"]
    tail.rotation_mode = "QUATERNION"
    give_bone_model(rig, folder)
    own.rig_live = True
    live = {frame: bones_at(rig, frame) for frame in (3, 12, 20)}
    choose(rig)
    bpy.ops.object.mode_set(mode="POSE")
    bpy.ops.nla.bake(
        frame_start=1,
        frame_end=24,
        only_selected=False,
        visual_keying=True,
        use_current_action=True,
        bake_types={"POSE"},
    )
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    for shown in (True, False):
        for frame, expected in live.items():
            assert apart(bones_at(rig, frame), expected) < SAME, (shown, frame)
        bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"), copy=True)
        own.rig_live = False
    assert rig.pose.bones["hair.01"].rotation_mode == "QUATERNION" and not own.rig_kept and not messages(), messages()
    with bpy.data.libraries.load(str(folder / "shot.blend")) as (_, there):
        there.objects = ["Rig"]
    assert there.objects[0].pose.bones["hair.01"].rotation_mode == "QUATERNION"

    tail.rotation_mode = "XYZ"
    tail.keyframe_insert("rotation_euler", frame=1)
    own.rig_live = True
    scene.frame_set(5)
    assert tail.rotation_mode == "AXIS_ANGLE" and not messages(), messages()
    tail.keyframe_insert("rotation_axis_angle", frame=5)
    own.rig_live = False
    assert tail.rotation_mode == "XYZ"

    rig.animation_data_clear()
    scenes.dance(rig)
    tail.rotation_mode = "XYZ"
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    mode = tail.rotation_mode
    tail.keyframe_insert(rotations.CHANNELS[mode], frame=5)  # below the baked keys
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"} and bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    assert tail.rotation_mode == mode != "XYZ"
