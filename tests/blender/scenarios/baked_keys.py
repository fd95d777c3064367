# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked keys of hair bones beside what else turns them: keys of the artist's own, other bakes, Live."""

import sys
from pathlib import Path
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import (
    SAME,
    apart,
    bones_at,
    give_bone_model,
    messages,
    refused,
)


def keyed_bones(folder: Path) -> None:
    """Hair bones that the artist has keyed, for example by a key on the whole character: the baked keys of a part of the shot show all
    the same, and muting them gives the artist's back in all of it, as for bones without keys.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.body(rig)
    scenes.dance(rig)
    first, second = (rig.pose.bones[name] for name in ("hair.01", "hair.02"))
    give_bone_model(rig, folder)
    track, panel = "Neuralocks Hair", bpy.context.scene.neuralocks
    panel.use_scene_range, panel.frame_start, panel.frame_end = False, 2, 18

    for keyed in (False, True):
        first.rotation_mode, first.rotation_quaternion = "QUATERNION", (0.9, 0.3, 0.1, -0.3)
        second.rotation_euler = (0.1, 0.2, -0.1)
        for frame in (1, 24) if keyed else ():
            first.rotation_quaternion[1] = second.rotation_euler[0] = 0.02 * frame
            first.keyframe_insert("rotation_quaternion", frame=frame)
            second.keyframe_insert("rotation_euler", frame=frame)
        still = {frame: bones_at(rig, frame) for frame in (1, 3, 17, 23)}
        rig.neuralocks_character.rig_live = True
        live = {frame: bones_at(rig, frame) for frame in (3, 17)}
        assert apart(live[3], still[3]) > 0.01 and not messages(), messages()
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
        for muted, expected in ((False, live), (True, still), (False, live)):
            rig.animation_data.nla_tracks[track].mute = muted
            for frame, matrices in expected.items():
                assert apart(bones_at(rig, frame), matrices) < SAME, (keyed, muted, frame)
        assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
        assert first.rotation_mode == "QUATERNION" and second.rotation_mode == "XYZ"
        assert not rig.animation_data.nla_tracks and not [a for a in bpy.data.actions if "Hair" in a.name]
        for frame, matrices in still.items():
            assert apart(bones_at(rig, frame), matrices) < 1e-6


def many_keys(folder: Path) -> None:
    """Keys are straight between frames, and are not made one by one, which for 60 bones took seconds during which Blender stood still;
    what bones did before that did not move is one key.
    """
    from dcc_addon.scene.keys import hair_keys, keyframes

    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    bpy.context.scene.neuralocks.subframes = 8
    give_bone_model(rig, folder)
    steps = []

    def counted(frame, _event, _argument):
        if frame.f_code.co_filename in (hair_keys.__file__, keyframes.__file__):
            steps.append(frame.f_lineno)
        return counted

    sys.settrace(counted)
    try:
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    finally:
        sys.settrace(None)
    curves = scenes.fcurves_of(bpy.data.actions["Rig Hair"])
    assert len(curves) == 4 and all(key.interpolation == "LINEAR" for curve in curves for key in curve.keyframe_points)
    assert len(steps) < sum(len(curve.keyframe_points) for curve in curves)
    before = scenes.fcurves_of(bpy.data.actions["Rig Before Hair"])
    assert [len(curve.keyframe_points) for curve in before] == [1] * 4


@patch.multiple("dcc_addon.operators.base", SAMPLED=0.0, _running=["as in a window"])
def keyed_anew(folder: Path) -> None:
    """A second bake of the hair bones that is refused or cancelled leaves the first one, and Live, as they are; one that succeeds
    replaces it, and starts from the bones as they were before the first.
    """
    from types import SimpleNamespace

    from dcc_addon.operators.rig import NEURALOCKS_OT_bake_keys

    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    own, bone = rig.neuralocks_character, rig.pose.bones["hair.01"]
    bone.rotation_euler = (0.1, 0.2, -0.1)
    give_bone_model(rig, folder)
    model = own.rig_model

    still = bones_at(rig, 5)
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    keyed = bones_at(rig, 5)
    assert apart(still, keyed) > 0.01

    def same() -> bool:
        tracks = rig.animation_data.nla_tracks
        names = [track.name for track in tracks if not track.mute]
        return names == ["Neuralocks Before Hair", "Neuralocks Hair"] and apart(bones_at(rig, 5), keyed) < SAME

    own.rig_model = "/nowhere.neuralocks"
    refused(bpy.ops.neuralocks.bake_keys, "no such model")
    assert same()
    own.rig_model = model
    own.rig_live = True
    steps = NEURALOCKS_OT_bake_keys.steps(SimpleNamespace(), bpy.context)
    next(steps)
    assert not same()
    bpy.context.view_layer.update()
    next(steps)
    steps.close()
    assert same() and own.rig_live and not messages(), messages()
    own.rig_live = False
    assert same()
    rig.animation_data.nla_tracks["Neuralocks Hair"].is_solo = own.rig_live = True
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"} and same() and not own.rig_live
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    assert bone.rotation_mode == "XYZ" and apart(bones_at(rig, 5), still) < 1e-6


def keys_under_live(folder: Path) -> None:
    """Live is switched on over baked keys, and the keys are removed meanwhile: Live continues, and at the end the hair bones are
    turned as the artist had turned them.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    scene, own, bone = bpy.context.scene, rig.neuralocks_character, rig.pose.bones["hair.01"]
    bone.rotation_euler = turned = (0.3, 0.1, 0.2)
    give_bone_model(rig, folder)

    def as_before():
        assert bone.rotation_mode == "XYZ" and apart(np.array(bone.rotation_euler), np.array(turned)) < 1e-6

    own.rig_live = True
    live = bones_at(rig, 11)
    own.rig_live = False
    as_before()
    for muted in (False, True):
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
        rig.animation_data.nla_tracks["Neuralocks Hair"].mute = muted
        scene.frame_set(9)
        own.rig_live = True
        scene.frame_set(11)
        assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
        assert apart(bones_at(rig, 11), live) < SAME and not messages(), messages()
        own.rig_live = False
        as_before()
        bpy.context.view_layer.update()
        refused(bpy.ops.neuralocks.remove_keys, "no baked hair keys")
    assert not own.rig_kept


def tracks_deleted_by_hand(folder: Path) -> None:
    """Baked keys whose tracks were deleted in the NLA editor, one or both, are still removed: the hair bones turn as the artist had
    keyed them, also after another bake; other characters' are not, and what the artist has keyed since stays.
    """
    rigs = [scenes.armature(name, bones=scenes.BONES + scenes.TAIL) for name in ("Rig", "Other")]
    for rig in rigs:
        scenes.dance(rig)
        bone = rig.pose.bones["hair.01"]
        for frame, angle in ((1, 0.2), (24, 0.9)):
            bone.rotation_euler = angle, 0.1, 0
            bone.keyframe_insert("rotation_euler", frame=frame)
    rig, other = rigs
    bone = rig.pose.bones["hair.01"]
    expected = {frame: bones_at(rig, frame) for frame in (1, 9, 24)}
    give_bone_model(rig, folder)

    def bake_and_delete(*names) -> None:
        assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
        for name in names:
            rig.animation_data.nla_tracks.remove(rig.animation_data.nla_tracks[name])

    for names in (("Neuralocks Hair",), ("Neuralocks Before Hair",), ("Neuralocks Hair", "Neuralocks Before Hair")):
        bake_and_delete(*names)
        bpy.data.actions["Rig Hair"].use_fake_user = True
        bpy.context.scene.neuralocks.armature = other
        refused(bpy.ops.neuralocks.remove_keys, "Other", "no baked hair keys")
        bpy.context.scene.neuralocks.armature = rig
        bake_and_delete(*names)
        assert bone.rotation_mode == "QUATERNION"
        assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
        assert not rig.animation_data.nla_tracks and bone.rotation_mode == "XYZ"
        for frame, matrices in expected.items():
            assert apart(bones_at(rig, frame), matrices) < 1e-6, (names, frame)
        refused(bpy.ops.neuralocks.remove_keys, "Rig", "no baked hair keys")
        for action in [action for action in bpy.data.actions if "Hair" in action.name]:
            bpy.data.actions.remove(action)
    # The character is renamed, copied and saved in between, and another takes its name.
    both = "Neuralocks Hair", "Neuralocks Before Hair"
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    copy = rig.copy()
    bpy.context.scene.collection.objects.link(copy)
    for each in (rig, copy):
        for name in both:
            each.animation_data.nla_tracks.remove(each.animation_data.nla_tracks[name])
    rig.name, copy.name = "Hero", "Stunt"
    other.name = "Rig"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "renamed.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(folder / "renamed.blend"))
    bpy.context.scene.neuralocks.armature = bpy.data.objects["Rig"]
    refused(bpy.ops.neuralocks.remove_keys, "Rig", "no baked hair keys")
    for name in ("Stunt", "Hero"):
        rig = bpy.context.scene.neuralocks.armature = bpy.data.objects[name]
        assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
        for frame, matrices in expected.items():
            assert apart(bones_at(rig, frame), matrices) < 1e-6, (name, frame)
    # A track that was renamed is the artist's.
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    data = rig.animation_data
    for name in both:
        data.nla_tracks[name].name = f"My {name}"
    refused(bpy.ops.neuralocks.remove_keys, "Hero", "no baked hair keys")
    for name in both:
        data.nla_tracks.remove(data.nla_tracks[f"My {name}"])
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"} and apart(bones_at(rig, 9), expected[9]) < 1e-6
    bone = rig.pose.bones["hair.01"]
    bake_and_delete(*both)
    bone.keyframe_insert("rotation_quaternion", frame=1)
    bone.keyframe_delete("rotation_euler", frame=1)
    bone.keyframe_delete("rotation_euler", frame=24)
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"} and bone.rotation_mode == "QUATERNION"
