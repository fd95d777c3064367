# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair bones: live, baked and exported the same, without their mesh, and with other names."""

import json
import shutil
from pathlib import Path

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, bones_at, give_bone_model, make_live, messages


def bones(folder: Path) -> None:
    """Hair bones: live equals baked keys; keys on exactly these bones, in a separate action that can be muted."""
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
    """A model knows its bones: they move even if the mesh is not rendered, or there is none."""
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


def renamed_bones(folder: Path) -> None:
    """A renamed bone is noticed like an added one; it is turned as it was before it was live."""
    from dcc_addon.interface.panels import findings
    from dcc_addon.live import view

    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    scene = bpy.context.scene
    give_bone_model(rig, folder)
    own, bone = (0.1, 0.2, -0.1), rig.pose.bones["hair.01"]
    bone.rotation_euler = own
    rig.neuralocks_character.rig_live = True
    scene.frame_set(5)
    assert bone.rotation_mode == "QUATERNION"
    assert not messages() and not view.needs_sampling(scene)
    assert findings(rig)[0][0] == "Head: head"
    rig.data.bones["hair.01"].name, rig.data.bones["head"].name = "hair.root", "Head"
    assert view.needs_sampling(scene) == [rig] and findings(rig)[0][0] == "Head: Head"
    scene.frame_set(6)
    assert "bones have changed" in messages()["Rig"], messages()
    bone = rig.pose.bones["hair.root"]
    assert bone.rotation_mode == "XYZ" and apart(np.array(bone.rotation_euler), np.array(own)) < 1e-6
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    scene.frame_set(7)
    assert "hair_01" in messages()["Rig"], messages()  # the model was made for other bones


def another_model(folder: Path) -> None:
    """Bones that only one of two models turns are restored when the other one takes over, and when Live goes off."""
    side = (("hair.L", "head", (0.09, 0, 1.7), (0.14, 0, 1.6)), ("hair.L.02", "hair.L", (0.14, 0, 1.6), (0.15, 0, 1.5)))
    models = []
    for name, more in (("Few", ()), ("Rig", side)):
        rig = scenes.armature(name, scenes.BONES + scenes.TAIL + more)
        scenes.dance(rig)
        (folder / name).mkdir()
        give_bone_model(rig, folder / name)
        models.append(rig.neuralocks_character.rig_model)
    few, every = models
    own, tail, lock = rig.neuralocks_character, rig.pose.bones["hair.01"], rig.pose.bones["hair.L"]
    tail.rotation_euler, lock.rotation_euler = (0.1, 0.2, 0.3), (0.3, 0.1, 0.2)
    rest = bones_at(rig, 12)

    def turned(bone) -> float:
        return apart(np.array(bone.matrix_basis), at_rest[bone.name])

    at_rest = {bone.name: np.array(bone.matrix_basis) for bone in rig.pose.bones}
    own.rig_model, own.rig_live = few, True
    bones_at(rig, 12)
    assert turned(tail) > 0.01 and turned(lock) < 1e-6 and not messages(), messages()
    for model, moves in ((every, True), (few, False), (every, True)):
        own.rig_model = model
        bones_at(rig, 12)
        assert turned(tail) > 0.01 and (turned(lock) > 0.01) == moves and not messages(), (model, messages())
    shutil.copy(few, every)  # retrained under the same name, for fewer bones
    bones_at(rig, 9)
    bones_at(rig, 12)
    assert turned(tail) > 0.01 and turned(lock) < 1e-6 and not messages(), messages()
    own.rig_live = False
    assert apart(bones_at(rig, 12), rest) < 1e-6 and tail.rotation_mode == lock.rotation_mode == "XYZ"


def forged_memories(folder: Path) -> None:
    """What a file remembers of bones and modifiers may have been written by anybody: values that the add-on never stores are
    ignored, the rest comes back, and live bones still know their rest.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.body(rig)
    scenes.dance(rig)
    strands = scenes.hair(rig)
    own, first, second = rig.neuralocks_character, rig.pose.bones["hair.01"], rig.pose.bones["hair.02"]
    give_bone_model(rig, folder)
    whole = [[0.9, 0.3, 0.1, -0.3], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]
    place = [0.0] * 6
    first.rotation_mode = second.rotation_mode = "QUATERNION"
    first.rotation_quaternion = whole[0]
    rest = bones_at(rig, 12)
    for values in (
        [],
        [[]],
        ["XYZ"],
        ["XYZ", *whole],
        ["ABC", *whole, place, []],
        ["XYZ", *whole[1:], whole[0], place, []],
        ["XYZ", *whole, [{}], []],
        ["XYZ", *whole, place, [3]],
    ):
        own.rig_kept = json.dumps({"hair.01": values, "hair.02": ["QUATERNION", *whole, place, []]})
        own.rig_live = True
        bones_at(rig, 9)
        own.rig_live = False
        assert apart(np.array(second.rotation_quaternion), np.array(whole[0])) < 1e-6 and not own.rig_kept, values
        first.rotation_quaternion, second.rotation_quaternion = whole[0], (1, 0, 0, 0)
        own.rig_kept = json.dumps({"hair.01": values})
        own.rig_live = True
        assert apart(bones_at(rig, 12), rest) > 0.01, "not live"
        own.rig_live = False
        assert apart(bones_at(rig, 12), rest) < 1e-6 and not messages(), (values, messages())
    scenes.surface_deform(strands)
    make_live(rig, strands)
    settings = strands.neuralocks_hair
    settings.live = False
    for values in ([], [3], [True], [True, True], [True, 3], [True, "Input"], [[]], ["Nothing"]):
        settings.muted = json.dumps({modifier.name: values for modifier in strands.modifiers} | {"Gone": values})
        settings.live = True
        bones_at(rig, 9)
        settings.live = False
        assert not settings.muted and not messages(), (values, messages())
