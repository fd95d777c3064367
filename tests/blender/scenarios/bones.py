# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair bones."""

from pathlib import Path
from unittest.mock import patch

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import (
    SAME,
    apart,
    baked_points,
    bones_at,
    give_bone_model,
    make_live,
    messages,
    needs_usd,
    points_at,
    refused,
)


def bones(folder: Path) -> None:
    """Hair bones: live equals baked keys; keys on exactly these bones, in an action of their own that can be muted."""
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.body(rig)
    scenes.dance(rig)
    before = {c.data_path: len(c.keyframe_points) for c in scenes.fcurves(rig)}
    scene = bpy.context.scene
    scene.neuralocks.armature = rig
    assert bpy.ops.neuralocks.find_chains() == {"FINISHED"}
    rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
    rig.pose.bones["hair.01"].rotation_euler = (0.3, 0.1, 0.2)  # posed by hand, in a mode that the hair does not use
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}

    def as_groomed():
        bone = rig.pose.bones["hair.01"]
        assert bone.rotation_mode == "XYZ" and apart(np.array(bone.rotation_euler), np.array([0.3, 0.1, 0.2])) < 1e-6

    still = {f: bones_at(rig, f) for f in (3, 11, 24)}
    rig.neuralocks_character.rig_live = True
    live = {f: bones_at(rig, f) for f in (24, 3, 11)}
    assert not messages(), messages()
    rig.neuralocks_character.rig_live = False
    as_groomed()
    rig.neuralocks_character.rig_live = True
    hair = [i for i, b in enumerate(rig.pose.bones) if b.name.startswith("hair")]
    others = [i for i in range(len(rig.pose.bones)) if i not in hair]
    for f in still:
        assert apart(live[f][others], still[f][others]) < 1e-6
        assert apart(live[f][hair], still[f][hair]) > 1e-3
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    for f in still:
        assert apart(bones_at(rig, f), live[f]) < SAME
    assert {c.data_path: len(c.keyframe_points) for c in scenes.fcurves(rig)} == before, "other keys were touched"
    track = rig.animation_data.nla_tracks["Neuralocks Hair"]
    keyed = {c.data_path.split('"')[1] for c in scenes.fcurves_of(track.strips[0].action)}
    assert keyed == {"hair.01", "hair.02"}, keyed
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    as_groomed()
    for f in still:
        assert apart(bones_at(rig, f), still[f]) < 1e-6
    scene.neuralocks.subframes = 2  # as many keys as a USD animation has samples
    rig.neuralocks_character.rig_live = True
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    denser = {f: bones_at(rig, f) for f in still}
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    action = rig.animation_data.nla_tracks["Neuralocks Hair"].strips[0].action
    at = sorted({round(key.co[0], 3) for curve in scenes.fcurves_of(action) for key in curve.keyframe_points})
    assert at == [scene.frame_start + i / 2 for i in range(2 * (scene.frame_end - scene.frame_start) + 1)], at
    for f in still:
        assert apart(bones_at(rig, f), denser[f]) < SAME
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    scene.neuralocks.subframes = 1

    scene.neuralocks.output = str(folder / "bakes" / "hair.usdc")
    assert bpy.ops.neuralocks.export_skel() == {"FINISHED"}
    from usd.shot.stage import read_rigs

    written = read_rigs(folder / "bakes" / "hair_rig.usdc")[0]
    leaves = [name.split("/")[-1] for name in written.character.skeleton.names]
    order = [leaves.index(bone.name.replace(".", "_")) for bone in rig.pose.bones]
    z_up = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for f in live:
        scene.frame_set(f)
        joints = written.joints_at(f)[order]
        place = np.array(rig.matrix_world)
        world = place @ live[f]
        assert apart(z_up @ joints[:, :3, :3], world[:, :3, :3]) < SAME
        assert apart(joints[:, :3, 3] @ z_up.T, world[:, :3, 3]) < SAME
    assert bpy.ops.neuralocks.export_c(filepath=str(folder / "hair.h")) == {"FINISHED"}
    assert "hair_02" in (folder / "hair.h").read_text()
    for f in still:
        assert apart(bones_at(rig, f)[others], still[f][others]) < 1e-6


def bones_without_their_mesh(folder: Path) -> None:
    """A model knows its bones: they move where the mesh is not rendered, and where there is none."""
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    skin = scenes.body(rig)
    scenes.dance(rig)
    give_bone_model(rig, folder)

    def live() -> np.ndarray:
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        rig.neuralocks_character.rig_live = True
        found = bones_at(rig, 11)
        assert not messages(), messages()
        rig.neuralocks_character.rig_live = False
        return found

    still, whole = bones_at(rig, 11), live()
    assert apart(whole, still) > 1e-3
    skin.hide_render = True
    assert apart(live(), whole) < SAME
    bpy.data.objects.remove(skin)
    assert apart(live(), whole) < SAME


def keyed_bones(folder: Path) -> None:
    """Hair bones that the artist has keyed, as a key on the whole character does: the baked keys show all the same, and
    muted give the artist's back, as they do for bones without keys.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.body(rig)
    scenes.dance(rig)
    first, second = (rig.pose.bones[name] for name in ("hair.01", "hair.02"))
    give_bone_model(rig, folder)
    track = "Neuralocks Hair"

    for keyed in (False, True):
        first.rotation_mode, first.rotation_quaternion = "QUATERNION", (0.9, 0.3, 0.1, -0.3)
        second.rotation_euler = (0.1, 0.2, -0.1)
        for frame in (1, 24) if keyed else ():
            first.rotation_quaternion[1] = second.rotation_euler[0] = 0.02 * frame
            first.keyframe_insert("rotation_quaternion", frame=frame)
            second.keyframe_insert("rotation_euler", frame=frame)
        still = {frame: bones_at(rig, frame) for frame in (3, 17)}
        rig.neuralocks_character.rig_live = True
        live = {frame: bones_at(rig, frame) for frame in still}
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


@patch.multiple("dcc_addon.operators.base", SAMPLED=0.0, _running=["as in a window"])
def keyed_anew(folder: Path) -> None:
    """A second bake of the hair bones that is refused, or cancelled, leaves the first one as it is, and Live; one that is
    not takes its place, and finds the bones as they were before the first.
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
    """Live switched on over baked keys, and the keys removed meanwhile: Live goes on, and in the end the hair bones are
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


def renamed_bones(folder: Path) -> None:
    """A bone that gets another name is noticed as one more bone would be; it is turned as it was before it was live."""
    from dcc_addon import live
    from dcc_addon.panels import findings

    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    scene = bpy.context.scene
    give_bone_model(rig, folder)
    own, bone = (0.1, 0.2, -0.1), rig.pose.bones["hair.01"]
    bone.rotation_euler = own
    rig.neuralocks_character.rig_live = True
    scene.frame_set(5)
    assert bone.rotation_mode == "QUATERNION"
    assert not messages() and not live.needs_sampling(scene)
    assert findings(rig)[0][0] == "Head: head"
    rig.data.bones["hair.01"].name, rig.data.bones["head"].name = "hair.root", "Head"
    assert live.needs_sampling(scene) == [rig] and findings(rig)[0][0] == "Head: Head"
    scene.frame_set(6)
    assert "bones have changed" in messages()["Rig"], messages()
    bone = rig.pose.bones["hair.root"]
    assert bone.rotation_mode == "XYZ" and apart(np.array(bone.rotation_euler), np.array(own)) < 1e-6
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    scene.frame_set(7)
    assert "hair_01" in messages()["Rig"], messages()  # the model was made for other bones


def strands_beside_keyed_bones(folder: Path) -> None:
    """Strands of a character whose hair bones are baked are those that it has without, or with live ones, shown and baked,
    whether the track is muted or not; a track with the star plays alone, also for them.
    """
    from dcc_addon.scene.up_to_date import notice
    from dcc_addon.session import session

    needs_usd()
    rig, scene = scenes.armature(bones=scenes.BONES + scenes.TAIL), bpy.context.scene
    scenes.body(rig)
    scenes.dance(rig)
    strands, out = scenes.hair(rig, 40, length=0.4), folder / "out.usdc"
    make_live(rig, strands, resolve=True)
    expected = {frame: points_at(strands, frame) for frame in (3, 11, 20)}

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
