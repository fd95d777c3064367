# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown live is what every way to a bake gives."""

from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from dcc_addon.interface.hair_notes import unnamed_model
from tests.blender import scenes
from tests.blender.checks import (
    MODEL,
    SAME,
    apart,
    baked_points,
    make_live,
    messages,
    needs_usd,
    points_at,
    refused,
)


def one_result(folder: Path) -> None:
    """Live view, operator and Python call give the same points, with IK, constraints, drivers and moved objects in
    the rig.
    """
    rig = scenes.armature()
    skin = scenes.body(rig)
    scenes.dance(rig)
    scenes.constrain(rig)
    strands = scenes.hair(rig, 80)
    strands.scale = (1.2, 1.0, 0.8)  # unapplied
    make_live(rig, strands, bend=2.0, weight=1.3, clumping=2.0, motion=0.8)
    scene = bpy.context.scene
    rng = np.random.default_rng(0)
    frames = [int(f) for f in rng.permutation(np.arange(1, 25))]
    shown = {f: points_at(strands, f) for f in frames}
    for f in frames[::-1]:
        assert apart(points_at(strands, f), shown[f]) == 0.0, "scrubbing back changes the hair"
    assert apart(shown[1], shown[12]) > 0.01
    assert not messages(), messages()

    assert bpy.ops.neuralocks.bake(filepath=str(folder / "bake.usdc")) == {"FINISHED"}
    for f in frames:
        assert apart(baked_points(folder / "bake.usdc", "/Character/Hair_Hair", f), shown[f]) < SAME

    from usd.baking.bake import bake

    words = ["bend=2x", "weight=1.3x", "damping=1x", "clumping=2x"]
    bake(folder / "bake_shot.usdc", folder / "again.usdc", MODEL, material=words, strength=0.8)
    for f in frames[:6]:
        a, b = (baked_points(folder / name, "/Character/Hair_Hair", f) for name in ("bake.usdc", "again.usdc"))
        assert apart(a, b) < SAME, (f, apart(a, b))
    assert scene.frame_current == frames[0]
    assert skin.name in bpy.data.objects


def out_of_the_body(folder: Path) -> None:
    """Keep out of Body and a looped range: live equals the bake, and each makes a difference."""
    rig, strands = scenes.dancer(60, length=0.4, skinned=True)
    make_live(rig, strands, resolve=False)
    free = {f: points_at(strands, f) for f in (2, 13, 24)}
    strands.neuralocks_hair.resolve = True
    shown = {f: points_at(strands, f) for f in (13, 2, 24)}
    assert not messages(), messages()
    assert max(apart(free[f], shown[f]) for f in free) > 1e-4, "no hair was in the body"
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "out.usdc")) == {"FINISHED"}
    for f, points in shown.items():
        assert apart(baked_points(folder / "out.usdc", "/Character/Hair_Hair", f), points) < SAME
    # A body that differs in its seventh digit pushes some strand elsewhere.
    from dcc_addon.session import session
    from usd.shot.stage import read_shot

    read = read_shot(folder / "out_shot.usdc").grooms[0].attachment.character
    assert np.array_equal(read.body.points, session.rigs["Rig"].character.body.points)

    strands.neuralocks_hair.resolve = False
    assert apart(points_at(strands, 2), free[2]) == 0.0
    rig.neuralocks_character.loop = True
    shown = {f: points_at(strands, f) for f in (2, 13, 24)}
    assert apart(free[2], shown[2]) > 1e-4, "the second frame must remember the end of the range"
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "loop.usdc")) == {"FINISHED"}
    for f, points in shown.items():
        assert apart(baked_points(folder / "loop.usdc", "/Character/Hair_Hair", f), points) < SAME
    rig.neuralocks_character.loop = False
    assert apart(points_at(strands, 2), free[2]) == 0.0


def put_elsewhere(folder: Path) -> None:
    """A character jumps 3 m aside from one frame to the next: its hair does not feel the jump, live or baked."""
    from dcc_addon.session import session

    rig, strands = scenes.dancer(40)
    make_live(rig, strands)
    unmoved = {f: points_at(strands, f) for f in (12, 24)}
    for frame, aside in ((1, 0), (12, 0), (13, 3), (24, 3)):
        rig.delta_location = (aside, 0, 0)
        rig.keyframe_insert("delta_location", frame=frame)
    rig.neuralocks_character.loop = True
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    rig.neuralocks_character.loop = False
    shown = {f: points_at(strands, f) for f in (24, 13, 12, 20)}
    assert len(session.rigs["Rig"].clip.cuts) == 1
    assert "hair starts anew there" in session.rigs["Rig"].leaps[0]
    assert apart(shown[12], unmoved[12]) < 1e-3, (
        "the motion before it has no frame after it now, and nothing else changed"
    )
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "bake.usdc")) == {"FINISHED"}
    for f, points in shown.items():
        assert apart(baked_points(folder / "bake.usdc", "/Character/Hair_Hair", f), points) < SAME
    # Half a second later, motion from before the cut would still be felt, but not three metres in a frame.
    assert apart(shown[24] - (3, 0, 0), unmoved[24]) < 0.05


def other_frames(folder: Path) -> None:
    """A bake of more frames than the scene has, or fewer, is what is shown live: both remember the same past."""
    from dcc_addon.live import view
    from dcc_addon.session import session

    rig = scenes.armature(bones=scenes.BONES + scenes.TAIL)
    scenes.dance(rig)
    strands = scenes.hair(rig, 40)
    scene = bpy.context.scene
    scene.frame_end = 12
    make_live(rig, strands)
    clamped = points_at(strands, 18)
    settings = scene.neuralocks
    settings.use_scene_range, settings.frame_start, settings.frame_end = False, 1, 24
    assert view.needs_sampling(scene) == [rig], "what is to be baked has changed"
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "more.usdc")) == {"FINISHED"}
    shown = {f: points_at(strands, f) for f in (24, 5, 18)}
    assert not session.rigs["Rig"].stale and apart(shown[18], clamped) > 1e-3
    for f, points in shown.items():
        assert apart(baked_points(folder / "more.usdc", "/Character/Hair_Hair", f), points) < SAME

    settings.frame_start, settings.frame_end = 4, 9
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "fewer.usdc")) == {"FINISHED"}
    for f in (4, 9):
        assert apart(baked_points(folder / "fewer.usdc", "/Character/Hair_Hair", f), points_at(strands, f)) < SAME
    scene.render.fps = 30
    points_at(strands, 7)
    assert session.rigs["Rig"].stale, "frames last longer"

    settings.frame_start, settings.frame_end = 1, 24
    rig.neuralocks_character.rig_model = str(scenes.rig_model(rig, folder / "rig.neuralocks"))
    assert bpy.ops.neuralocks.bake_keys() == {"FINISHED"}
    keyed = bpy.data.objects["Rig"].pose.bones["hair.02"]
    scene.frame_set(18)
    turn = np.array(keyed.rotation_quaternion)
    assert bpy.ops.neuralocks.remove_keys() == {"FINISHED"}
    rig.neuralocks_character.rig_live = True
    scene.frame_set(18)
    shown = np.array(keyed.rotation_quaternion)
    assert min(apart(turn, shown), apart(turn, -shown)) < SAME
    assert not messages(), messages()


def shutter_at_the_ends(folder: Path) -> None:
    """A bake ends with its frames, while Blender moves the character on; in a bake that is a frame longer, motion blur of the first
    and the last frame is as it is live.
    """
    rig, scene = scenes.armature(), bpy.context.scene
    scenes.dance(rig, (-5, 30))
    strands = scenes.hair(rig, 20)
    settings = scene.neuralocks
    settings.subframes = 4
    for longer in (False, True):
        settings.use_scene_range, settings.frame_start, settings.frame_end = not longer, 0, 25
        make_live(rig, strands)
        assert bpy.ops.neuralocks.bake(filepath=str(folder / "blurred.usdc")) == {"FINISHED"}
        for time in (0.75, 1.25, 24.25):
            baked = baked_points(folder / "blurred.usdc", "/Character/Hair_Hair", time)
            same = apart(baked, points_at(strands, int(time), time % 1)) < SAME
            assert same == (longer or time == 1.25), (longer, time)


def blender_export(folder: Path) -> None:
    """A bake of the scene as Blender itself exports it equals the live view."""
    needs_usd()
    rig, strands = scenes.dancer(40, skinned=True)
    make_live(rig, strands)
    _equal_when_exported(folder, strands)


def leaning(folder: Path) -> None:
    """Whether an armature object leans or its hips do, the hair is the same: live, baked, and through Blender's own export."""
    shown = []
    for joint in (False, True):
        scenes.empty()
        rig = scenes.armature()
        scenes.dance(rig)
        if joint:
            hips, lean = rig.pose.bones["hips"], Matrix.Rotation(0.4, 4, "X")
            hips.matrix_basis = hips.bone.matrix_local.inverted() @ lean @ hips.bone.matrix_local
        else:
            rig.rotation_euler.x = 0.4
        strands = scenes.hair(rig, 40)
        make_live(rig, strands, resolve=False)
        shown.append({f: points_at(strands, f) for f in (2, 13, 24)})
        out = folder / f"baked_{joint}.usdc"
        assert bpy.ops.neuralocks.bake(filepath=str(out)) == {"FINISHED"}
        for f, points in shown[-1].items():
            assert apart(baked_points(out, "/Character/Hair_Hair", f), points) < SAME
        if getattr(bpy.app.build_options, "usd", False):
            _equal_when_exported(folder, strands, resolve=False)
    for f, points in shown[0].items():
        assert apart(points, shown[1][f]) < SAME
    assert not messages(), messages()


def _equal_when_exported(folder: Path, strands, **options) -> None:
    """A bake of the scene as Blender itself exports it shows what is live."""
    from pxr import Usd, UsdGeom

    from usd.baking.bake import bake

    shown = {f: points_at(strands, f) for f in (2, 13, 24)}
    strands.neuralocks_hair.live = False
    bpy.context.scene.frame_set(1)
    shot = folder / "scene.usdc"
    bpy.ops.wm.usd_export(filepath=str(shot), export_animation=True, export_armatures=True, export_materials=False)
    bake(shot, folder / "exported.usdc", MODEL, **options)
    stage = Usd.Stage.Open(str(folder / "exported.usdc"))
    prim = next(p for p in stage.Traverse() if p.IsA(UsdGeom.BasisCurves))
    for f, points in shown.items():
        gap = apart(baked_points(folder / "exported.usdc", str(prim.GetPath()), f), points)
        print(f, gap)
        assert gap < SAME


def attached(folder: Path) -> None:
    """Bake and Attach: the cache on each hair object shows what was live, without the add-on."""
    import dcc_addon
    from dcc_addon.session import session

    needs_usd()
    rig = scenes.armature()
    scenes.dance(rig)
    strands, fringe = scenes.hair(rig, 40), scenes.hair(rig, 20, name="Fringe.L")
    make_live(rig, fringe)
    make_live(rig, strands)
    bpy.context.scene.neuralocks.output = str(folder / "cache.usdc")
    shown = {f: points_at(strands, f) for f in (1, 8, 17, 24)}
    beside = points_at(fringe, 17)
    for hair in (strands, fringe):
        bpy.context.scene.neuralocks.hair = hair
        assert bpy.ops.neuralocks.bake_attach() == {"FINISHED"}
    for f, points in shown.items():
        assert apart(points_at(strands, f), points) < SAME
    assert apart(points_at(fringe, 17), beside) < SAME, "both play the file of the panel"
    fringe.neuralocks_hair.armature = None
    in_use, sampled = str(folder / "cache_Fringe_L.usdc"), session.rigs["Rig"]
    refused(lambda: bpy.ops.neuralocks.bake(filepath=in_use), "Fringe.L plays this file")
    assert session.rigs["Rig"] is sampled, "refused only after minutes of sampling"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "farm.blend"))
    dcc_addon.unregister()
    bpy.ops.wm.open_mainfile(filepath=str(folder / "farm.blend"))
    for f, points in shown.items():
        assert apart(points_at(bpy.data.objects["Hair"], f), points) < SAME
    dcc_addon.register()


def scaled_head(folder: Path) -> None:
    """A head that its bones scale, throughout or for a while, with hair parented to the bone or to the armature."""
    rig, strands = scenes.dancer(40, skinned=True)
    bpy.context.scene.frame_end = 12
    for number, (bone, sizes) in enumerate((("head", (1.25, 1.25)), ("spine", (0.7, 1.3)))):
        for frame, size in zip((1, 12), sizes, strict=True):
            rig.pose.bones[bone].scale = (size, size, size)
            rig.pose.bones[bone].keyframe_insert("scale", frame=frame)
        if number:
            rest = rig.data.bones["head"]
            strands.parent_type, strands.parent_bone = "BONE", "head"
            strands.matrix_parent_inverse = (rest.matrix_local @ scenes.translation((0, rest.length, 0))).inverted()
        make_live(rig, strands)
        shown = {f: points_at(strands, f) for f in (2, 7, 12)}
        assert not messages(), messages()
        out = folder / f"scaled_{number}.usdc"
        assert bpy.ops.neuralocks.bake(filepath=str(out)) == {"FINISHED"}
        for f, points in shown.items():
            assert apart(baked_points(out, "/Character/Hair_Hair", f), points) < SAME


def shipped_shot(folder: Path) -> None:
    """The shipped shot, built in Blender by the script of the pictures, moves as a bake of its stage does."""
    from examples import blender_shot
    from usd.baking.bake import bake

    armature, _, strands = blender_shot.build()
    make_live(armature, strands)
    strands.neuralocks_hair.model = ""  # a shipped one
    out = bake(blender_shot.SHOT, folder / "shot.usdc", frames=[40, 90], velocities=False).path
    y_up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for frame in (90, 40):
        assert apart(points_at(strands, frame), baked_points(out, "/Body/Hair", frame) @ y_up.T) < SAME
    assert unnamed_model(strands) == "Shipped with the add-on: long hair"
