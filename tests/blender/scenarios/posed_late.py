# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts that pose a rig after Blender has evaluated a frame, as jiggle scripts and Python rigs do."""

import io
import math
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

import bpy
import numpy as np

from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, make_live, messages, points_at

FRAMES = (3, 9, 20, 12)


def posed_late(folder: Path) -> None:
    """Live hair stays on a head that such a script moves, by unkeyed bones, by keyed ones, or by a constraint's target, wherever
    the script is on Blender's list and whenever it was added, and equals a bake.
    """
    from dcc_addon.session import session

    for move in (_neck, _head, _target):
        for place in (0, 99):
            scenes.empty()
            rig, scene = scenes.armature(), bpy.context.scene
            scenes.dance(rig)
            rig.pose.bones["spine"].constraints.new("COPY_ROTATION").target = _looked_at()
            strands = scenes.hair(rig, 10)
            make_live(rig, strands, motion=0.0, resolve=False)
            with _called(move, place):
                scene.frame_set(2)  # the motion was sampled without the script
                assert session.rigs["Rig"].stale, move
                assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
                seen = {frame: _on_head(rig, strands, frame) for frame in FRAMES}
                for frame in FRAMES[::-1]:
                    assert apart(_on_head(rig, strands, frame), seen[frame]) == 0.0, (move, place, frame)
                roots = np.array([points[::24] for points in seen.values()])
                assert np.ptp(roots, axis=0).max() < 1e-4, (move, place)
                assert not session.rigs["Rig"].stale and not messages(), (move, messages())
                strands.neuralocks_hair.motion = 1.0
                shown = {frame: points_at(strands, frame) for frame in FRAMES}
                if getattr(bpy.app.build_options, "usd", False):
                    assert bpy.ops.neuralocks.bake(filepath=str(folder / "late.usdc")) == {"FINISHED"}
                    for frame, points in shown.items():
                        assert apart(baked_points(folder / "late.usdc", "/Character/Hair_Hair", frame), points) < SAME


def rendered_late(folder: Path) -> None:
    """Blender renders a rig that is posed late differently from how it shows it, which is reported once; if the script poses it
    before the frame is evaluated, all is well.
    """
    rig, strands = scenes.dancer(10)
    scene = bpy.context.scene
    make_live(rig, strands, resolve=False)
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.engine, scene.render.filepath = "CYCLES", str(folder / "r_")
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.neuralocks.frame_start, scene.neuralocks.frame_end, scene.neuralocks.use_scene_range = 1, 24, False
    scene.frame_start, scene.frame_end = 5, 7
    for when, times in (("pre", 0), ("post", 1)):
        with _called(_neck, 0, when), redirect_stdout(io.StringIO()) as said:
            bpy.ops.render.render(animation=True)
        assert said.getvalue().count("frame_change_pre") == times, said.getvalue()
    assert "frame_change_pre" in messages()["Rig"], messages()


def _neck(scene, *_) -> None:
    bpy.data.objects["Rig"].pose.bones["neck"].rotation_euler.x = 0.4 * math.sin(scene.frame_current / 3)


def _head(scene, *_) -> None:
    bpy.data.objects["Rig"].pose.bones["head"].rotation_euler.x = 0.4 * math.sin(scene.frame_current / 3)


def _target(scene, *_) -> None:
    bpy.data.objects["Target"].rotation_euler.x = 0.4 * math.sin(scene.frame_current / 3)


def _looked_at():
    """What the spine follows; keyed, so that each frame begins with another rotation than the script gives it."""
    target = bpy.data.objects.new("Target", None)
    bpy.context.scene.collection.objects.link(target)
    target.keyframe_insert("rotation_euler", frame=1)
    return target


@contextmanager
def _called(function, place: int, when: str = "post"):
    """In this block, Blender calls a function at each frame change, at a place in its list."""
    calls = getattr(bpy.app.handlers, f"frame_change_{when}")
    calls.insert(place, function)
    try:
        yield
    finally:
        calls.remove(function)


def _on_head(rig, strands, frame) -> np.ndarray:
    """Points (P, 3) of the hair at a frame as the head bone sees them."""
    points = points_at(strands, frame)
    evaluated = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
    back = np.linalg.inv(np.array(evaluated.matrix_world) @ np.array(evaluated.pose.bones["head"].matrix))
    return points @ back[:3, :3].T + back[:3, 3]
