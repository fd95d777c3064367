# SPDX-License-Identifier: GPL-3.0-or-later
"""What strands are attached to."""

from pathlib import Path
from unittest import SkipTest

import bpy

from tests.blender import panel, scenes
from tests.blender.checks import MODEL, SAME, apart, baked_points, make_live, messages, points_at


def control_rig(folder: Path) -> None:
    """Hair on the head bone of a rig that copies another one, or on that other one's, moves the same."""
    control = scenes.armature("Control")
    scenes.dance(control, (-8, 24))
    rig = scenes.armature("Deform")
    for bone in rig.pose.bones:
        copy = bone.constraints.new("COPY_TRANSFORMS")
        copy.target, copy.subtarget = control, bone.name
    plain, on_control = scenes.hair(rig, 30), scenes.hair(rig, 30, parent=False, name="OnControl")
    rest = control.data.bones["head"]
    on_control.parent, on_control.parent_type, on_control.parent_bone = control, "BONE", "head"
    on_control.matrix_parent_inverse = (rest.matrix_local @ scenes.translation((0, rest.length, 0))).inverted()
    bpy.context.scene.neuralocks.armature = rig
    for hair in (plain, on_control):
        hair.neuralocks_hair.model = MODEL
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    for hair in (plain, on_control):
        hair.neuralocks_hair.live = True
    bpy.context.scene.frame_set(9)
    points = scenes.points(plain)
    assert apart(scenes.points(on_control), points) < SAME and not messages(), messages()
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "control.usdc")) == {"FINISHED"}
    assert apart(baked_points(folder / "control.usdc", "/Character/Hair_OnControl", 9), points) < SAME


def ways_of_parenting(folder: Path) -> None:
    """Hair parented to the armature, to its head bone or to what is parented to that, constrained to the bone, or grown
    on a deformed surface moves in the same way, also if the first frame is not a rest pose.
    """
    rig = scenes.armature()
    skin = scenes.body(rig)
    scenes.dance(rig, (-8, 24))
    scene = bpy.context.scene
    by_object = scenes.hair(rig, 30, name="ByObject")
    by_bone = scenes.hair(rig, 30, name="ByBone")
    rest = rig.data.bones["head"]
    by_bone.parent_type, by_bone.parent_bone = "BONE", "head"
    # Bone parents count from the bone's tail.
    tail = rest.matrix_local @ scenes.translation((0, rest.length, 0))
    by_bone.matrix_parent_inverse = tail.inverted()
    skull = bpy.data.objects.new("Skull", bpy.data.meshes.new("Skull"))
    skull.data.from_pydata([(0.1, 0, 1.6), (-0.1, 0, 1.6), (0, 0.1, 1.7)], [], [(0, 1, 2)])
    scene.collection.objects.link(skull)
    skull.parent, skull.parent_type, skull.parent_bone = rig, "BONE", "head"
    skull.matrix_parent_inverse = tail.inverted()
    on_skull = scenes.hair(rig, 30, name="OnSkull")
    on_skull.parent = skull
    constrained = scenes.hair(rig, 30, name="Constrained", parent=False)
    child_of = constrained.constraints.new("CHILD_OF")
    child_of.target, child_of.subtarget = rig, "head"
    child_of.inverse_matrix = rest.matrix_local.inverted()
    on_surface = scenes.hair(rig, 30, name="OnSurface")
    on_surface.parent = skin
    on_surface.data.surface = skin
    deform = scenes.surface_deform(on_surface)
    scene.neuralocks.armature = rig
    every = (by_object, by_bone, on_skull, constrained, on_surface)
    for hair in every:
        hair.neuralocks_hair.model = MODEL
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    for hair in every:
        hair.neuralocks_hair.live = True
    assert not deform.show_viewport and not deform.show_render
    for frame in (1, 9, 22):
        scene.frame_set(frame)
        assert not messages(), messages()
        points = {h.name: scenes.points(h) for h in every}
        for name, shown in points.items():
            assert apart(shown, points["ByObject"]) < SAME, name
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "all.usdc")) == {"FINISHED"}
    for name, shown in points.items():
        assert apart(baked_points(folder / "all.usdc", f"/Character/Hair_{name}", 22), shown) < SAME
    rig.neuralocks_character.body = skull
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    from dcc_addon.session import session

    character = session.rigs[rig.name].character
    assert set(character.body.joint_indices[character.body.joint_weights > 0]) == {character.head}
    on_surface.neuralocks_hair.live = False
    assert deform.show_viewport and deform.show_render


def riding(folder: Path) -> None:
    """A beard attached to the jaw rides on it, live and in bakes, also when the artist poses the jaw by hand. Hair that its own
    keys move gets a note, because it stays on the head; hair attached to the head or to what carries the whole body, or that stands
    still, does not.
    """
    from dcc_addon.session import session

    jaw = ("jaw", "head", (0, -0.02, 1.6), (0, -0.12, 1.57))
    rig, scene = scenes.armature(bones=[*scenes.BONES, jaw]), bpy.context.scene
    scenes.dance(rig)
    for frame, angle in ((1, 0.0), (12, 0.5), (24, 0.0)):
        rig.pose.bones["jaw"].rotation_euler.x = angle
        rig.pose.bones["jaw"].keyframe_insert("rotation_euler", frame=frame)
    hairs = {name: scenes.hair(rig, 10, name=name) for name in ("Beard", "OnHead", "OnHips", "Own", "OnRig", "Still")}
    for name, bone in (("Beard", "jaw"), ("OnHead", "head"), ("OnHips", "hips")):
        rest = rig.data.bones[bone]
        hairs[name].parent_type, hairs[name].parent_bone = "BONE", bone
        hairs[name].matrix_parent_inverse = (rest.matrix_local @ scenes.translation((0, rest.length, 0))).inverted()
    for frame in (1, 24):
        hairs["Own"].location.x = frame / 24
        hairs["Own"].keyframe_insert("location", frame=frame)
    hairs["Still"].parent = None
    for hair in hairs.values():
        hair.neuralocks_hair.model = MODEL
    beard = hairs["Beard"]
    on_jaw = {frame: points_at(beard, frame)[::24] for frame in (3, 9, 20)}
    on_head = points_at(hairs["OnHead"], 9)[::24]
    make_live(rig, beard)
    sampled = session.rigs["Rig"]
    assert list(sampled.hairs_off) == ["Own"] and "child of the bone" in sampled.hairs_off["Own"]
    assert any("Own: its object moves" in line for line in panel.drawn("INFO"))
    assert sampled.carriers == {"Beard": sampled.rig.bones.index("jaw")}
    shown = {frame: points_at(beard, frame) for frame in on_jaw}
    for frame, points in shown.items():
        assert apart(points[::24], on_jaw[frame]) < SAME, frame
    assert apart(shown[9][::24], on_head) > 0.01
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "bake.usdc")) == {"FINISHED"}
    for frame, points in shown.items():
        assert apart(baked_points(folder / "bake.usdc", "/Character/Hair_Beard", frame), points) < SAME, frame
    prepared = session.hairs["Beard"].hair
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert apart(points_at(beard, 9), shown[9]) == 0 and session.hairs["Beard"].hair is prepared
    scene.frame_set(9)
    rig.pose.bones["jaw"].rotation_euler.x += 0.2
    bpy.context.view_layer.update()
    by_hand = scenes.points(beard)[::24]
    beard.neuralocks_hair.live = False
    bpy.context.view_layer.update()
    assert apart(by_hand, scenes.points(beard)[::24]) < SAME
    rig.neuralocks_character.head_bone = "neck"
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    assert list(session.rigs["Rig"].carriers) == ["Beard"], "the head is no part of the neck"


def new_hair(folder: Path) -> None:
    """Hair as Blender adds it, with its own modifier that moves it on its surface: the modifier is off while hair is live, and live
    hair equals a bake.
    """
    rig = scenes.armature()
    skin = scenes.body(rig)
    scenes.dance(rig)
    groomed = scenes.hair(rig, 20, name="Groomed")
    skin.data.uv_layers.new(name="UVMap")
    bpy.context.view_layer.objects.active = skin
    if bpy.app.version < (4, 0):
        raise SkipTest("older ones add hair without a modifier of its own")
    assert bpy.ops.object.curves_empty_hair_add() == {"FINISHED"}
    strands = bpy.context.active_object
    strands.name = "Strands"
    own = [modifier.name for modifier in strands.modifiers]
    assert own
    strands.data.add_curves([24] * 20)
    for point, same in zip(strands.data.points, groomed.data.points):
        point.position = same.position
    bpy.data.objects.remove(groomed)
    make_live(rig, strands)
    assert not any(modifier.show_viewport or modifier.show_render for modifier in strands.modifiers), own
    live = points_at(strands, 9)
    assert not messages(), messages()
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "new.usdc")) == {"FINISHED"}
    assert apart(baked_points(folder / "new.usdc", "/Character/Hair_Strands", 9), live) < SAME
    strands.neuralocks_hair.live = False
    assert all(modifier.show_viewport and modifier.show_render for modifier in strands.modifiers)
