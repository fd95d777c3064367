# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones with another scale along each axis, as Stretch To, squash and animators give them."""

from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler

from tests.blender import scenes
from tests.blender.checks import (
    MODEL,
    SAME,
    apart,
    baked_points,
    bones_at,
    give_bone_model,
    make_live,
    messages,
    points_at,
)

FRAMES, FEW = (2, 13, 24), (2, 7, 12)
HALF = 2e-4
"""Error of a SkelAnimation's half-precision scales on a head [m]."""


def stretched(folder: Path) -> None:
    """Hair stays where its head carries it, live, baked, exported by Blender, and posed by hand, whatever is stretched below it, or
    if the head itself is stretched, with or without inheriting the scale.
    """
    from dcc_addon.session import session

    for number, (bone, scale, inherit) in enumerate(
        (
            ("chest", (0.875, 1.25, 1), "FULL"),
            ("neck", (1, 1.125, 0.9375), "FULL"),
            ("head", (1.125, 0.875, 1), "FULL"),
            ("neck", (0.9, 1.3, 0.9), "NONE"),
            ("neck", (0.9, 1.3, 0.9), "AVERAGE"),
        )
    ):
        scenes.empty()
        rig, scene = scenes.armature(), bpy.context.scene
        scene.frame_end = FEW[-1]
        scenes.body(rig)
        scenes.dance(rig)
        rig.pose.bones["neck"].rotation_euler.x = 0.3
        rig.data.bones["head"].inherit_scale = inherit
        for frame, size in ((1, (1, 1, 1)), (2, scale), (FEW[-1], scale)):
            rig.pose.bones[bone].scale = size
            rig.pose.bones[bone].keyframe_insert("scale", frame=frame)
        strands = scenes.hair(rig, 40)
        rest = rig.data.bones["head"]
        strands.parent_type, strands.parent_bone = "BONE", "head"
        strands.matrix_parent_inverse = (rest.matrix_local @ scenes.translation((0, rest.length, 0))).inverted()
        carried = {f: points_at(strands, f)[::24] for f in FEW}
        make_live(rig, strands, resolve=False)
        shown = {f: points_at(strands, f) for f in FEW}
        for f, roots in carried.items():
            assert apart(shown[f][::24], roots) < HALF, (bone, inherit, f, apart(shown[f][::24], roots))
        baked = folder / f"baked_{number}.usdc"
        assert bpy.ops.neuralocks.bake(filepath=str(baked)) == {"FINISHED"}
        for f, points in shown.items():
            assert apart(baked_points(baked, "/Character/Hair_Hair", f), points) < SAME, (bone, inherit, f)
        if getattr(bpy.app.build_options, "usd", False) and inherit == "FULL":
            _as_exported(folder / f"{number}.usdc", strands, shown)
        neck = rig.pose.bones["neck"]
        neck.rotation_euler = Euler((0.5, 0.2, 0.1))
        bpy.context.view_layer.update()
        by_hand = scenes.points(strands)
        assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
        assert apart(by_hand[::24], scenes.points(strands)[::24]) < HALF, (bone, inherit)
        assert not messages() and not session.rigs["Rig"].stale and scene.frame_current == FEW[-1]


def _as_exported(shot: Path, strands, shown) -> None:
    """A bake of the scene as Blender itself exports it shows what is live."""
    from pxr import Usd, UsdGeom

    from usd.baking.bake import bake

    strands.neuralocks_hair.live = False
    bpy.context.scene.frame_set(1)
    bpy.ops.wm.usd_export(filepath=str(shot), export_animation=True, export_armatures=True, export_materials=False)
    out = shot.with_name(f"exported_{shot.name}")
    bake(shot, out, MODEL, resolve=False)
    stage = Usd.Stage.Open(str(out))
    prim = next(p for p in stage.Traverse() if p.IsA(UsdGeom.BasisCurves))
    for f, points in shown.items():
        gap = apart(baked_points(out, str(prim.GetPath()), f), points)
        assert gap < 1e-3, (shot.name, f, gap)
    strands.neuralocks_hair.live = True
    bpy.context.scene.frame_set(FEW[-1])


def stretched_head_of_bones(folder: Path) -> None:
    """Hair bones below a head with three different scales: muting the keys leaves them as their own channels turn them, and
    exported they are where they are live.
    """
    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.body(rig)
    scenes.dance(rig)
    own = rig.neuralocks_character
    rig.pose.bones["head"].scale = (1.3, 1, 1.1)
    rig.pose.bones["hair.01"].rotation_euler = (0.3, 0.1, 0.2)
    give_bone_model(rig, folder)

    def bones(frame):
        found = bones_at(rig, frame)
        return np.array(rig.matrix_world) @ found

    still = {f: bones(f) for f in FRAMES}
    own.rig_live = True
    live = {f: bones(f) for f in FRAMES}
    assert bpy.ops.neuralocks.export_skel(filepath=str(folder / "rig.usdc")) == {"FINISHED"}
    from usd.shot.stage import read_rigs

    written = read_rigs(folder / "rig.usdc")[0]
    leaves = [name.split("/")[-1] for name in written.character.skeleton.names]
    order = [leaves.index(bone.name.replace(".", "_")) for bone in rig.pose.bones]
    z_up = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for f, matrices in live.items():
        assert apart(written.joints_at(f)[order][:, :3, 3] @ z_up.T, matrices[:, :3, 3]) < HALF
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    rig.animation_data.nla_tracks["Neuralocks Hair"].mute = True
    for f, matrices in still.items():
        assert apart(bones(f), matrices) < SAME
    assert not messages(), messages()


def stretched_limb(_folder: Path) -> None:
    """Below a stretched arm, a hand that inherits none of the stretch stays near to where Blender draws it, however far the arm is
    stretched; a mirrored prop in that hand does not prevent sampling.
    """
    from dcc_addon.services.rigs.axes import to_core
    from dcc_addon.session import session

    places = [((0.67 + 0.06 * k, 0, 1.43), (0.73 + 0.06 * k, 0, 1.43)) for k in range(4)]
    names = ("forearm.L", "hand.L", "finger.L", "tip.L", "prop")
    hand = [(name, above, *ends) for name, above, ends in zip(names[1:], names, places)]
    rig, scene = scenes.armature(bones=[*scenes.BONES, *hand]), bpy.context.scene
    skin = scenes.body(rig)
    skin.vertex_groups.remove(skin.vertex_groups["prop"])
    scenes.dance(rig)
    for name in names[1:]:
        rig.data.bones[name].inherit_scale = "NONE"
        rig.pose.bones[name].rotation_euler = (0.4, 0.3, 0.2)
    for frame, stretch in ((1, 1.0), (2, 1.5), (13, 4.0), (14, 30.0), (24, 30.0)):
        rig.pose.bones["forearm.L"].scale = (stretch**-0.5, stretch, stretch**-0.5)
        rig.pose.bones["prop"].scale.x = -1 if frame > 13 else 1
        for name in ("forearm.L", "prop"):
            rig.pose.bones[name].keyframe_insert("scale", frame=frame)
    strands = scenes.hair(rig, 20)
    make_live(rig, strands)
    sampled, core = session.rigs["Rig"], to_core(1.0)
    for frame in FRAMES:
        scene.frame_set(frame)
        drawn = skin.evaluated_get(bpy.context.evaluated_depsgraph_get())
        there = np.array([core[:3, :3] @ (drawn.matrix_world @ vertex.co) for vertex in drawn.data.vertices])
        joints = sampled.clip.joints[sampled.motion.row(frame)]
        made = sampled.character.body.posed(joints @ sampled.character.inverse_bind)
        assert apart(made, there) < 0.1, (frame, apart(made, there))
    assert not messages(), messages()
