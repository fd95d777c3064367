# SPDX-License-Identifier: GPL-3.0-or-later
"""A rendered clip of the shipped shot with live hair, without a display:

    .venv-blender-4.5/bin/python examples/blender_clip.py OUT_FOLDER [--model FILE] [--frames 60:146:2] [--size 400]

Writes single frames, and makes `clip.gif` from them if pillow is installed for Blender.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import blender_shot
import bpy
import numpy as np
from mathutils import Vector

RATE = 12
"""Pictures a second: every other frame of the shot."""


def main() -> None:
    """Build, light, render."""
    parser = argparse.ArgumentParser()
    parser.add_argument("out", type=Path)
    parser.add_argument("--model", default="")
    parser.add_argument("--frames", default="60:146:2")
    parser.add_argument("--size", type=int, default=400)
    parser.add_argument("--samples", type=int, default=16)
    parser.add_argument("--engine", choices=["CYCLES", "EEVEE"], default="CYCLES")
    wanted = parser.parse_args()
    import dcc_addon

    dcc_addon.register()
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    armature, _, hair = blender_shot.build()
    hair.neuralocks_hair.model = wanted.model
    bpy.ops.neuralocks.sample_motion()
    hair.neuralocks_hair.live = True
    stage(armature)
    settings(wanted)
    scene = bpy.context.scene
    pictures = []
    wanted.out.mkdir(parents=True, exist_ok=True)
    numbers = [int(n) for n in wanted.frames.split(":")]
    for frame in range(numbers[0], numbers[1] + 1, numbers[2] if len(numbers) > 2 else 1):
        scene.frame_set(frame)
        follow(armature)
        scene.render.filepath = str(wanted.out / f"frame_{frame:04d}.png")
        bpy.ops.render.render(write_still=True)
        pictures.append(scene.render.filepath)
    dcc_addon.unregister()
    print(clip(wanted.out, pictures))


def stage(armature) -> None:
    """A soft grey room, a key light, a rim light that shows the hair, a camera."""
    scene = bpy.context.scene
    world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0):  # later ones always do
        world.use_nodes = True
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs[0].default_value = (0.055, 0.06, 0.075, 1)
    background.inputs[1].default_value = 1.0
    scene.world = world
    for name, where, power, size in (("Key", (-1.6, -2.2, 2.6), 130, 1.2), ("Rim", (1.4, 1.6, 2.4), 55, 0.8)):
        light = bpy.data.lights.new(name, "AREA")
        light.energy, light.size = power, size
        lamp = bpy.data.objects.new(name, light)
        lamp.parent_type = "OBJECT"
        scene.collection.objects.link(lamp)
        lamp["offset"] = where
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens = 80
    scene.collection.objects.link(camera)
    scene.camera = camera
    follow(armature)


def follow(armature) -> None:
    """Make camera and lights follow the hips, so that the head's own motion shows."""
    graph = bpy.context.evaluated_depsgraph_get()
    posed = armature.evaluated_get(graph)
    bone = posed.pose.bones[0]
    place = (posed.matrix_world @ bone.matrix).to_translation()
    target = Vector((place.x, place.y, 1.58))
    camera = bpy.context.scene.camera
    camera.location = target + Vector((-0.62, -1.3, 0.1))
    camera.rotation_euler = (target - camera.location).to_track_quat("-Z", "Y").to_euler()
    for lamp in bpy.data.objects:
        if lamp.type == "LIGHT":
            lamp.location = Vector((place.x, place.y, 0)) + Vector(lamp["offset"])
            lamp.rotation_euler = (target - lamp.location).to_track_quat("-Z", "Y").to_euler()


def settings(wanted) -> None:
    """Few samples and a denoiser."""
    scene = bpy.context.scene
    scene.render.resolution_x = scene.render.resolution_y = wanted.size
    scene.render.film_transparent = False
    scene.view_settings.view_transform = "Standard"
    if wanted.engine == "EEVEE":
        scene.render.engine = "BLENDER_EEVEE_NEXT" if (4, 2) <= bpy.app.version < (5, 0) else "BLENDER_EEVEE"
        scene.eevee.taa_render_samples = wanted.samples
        return
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.max_bounces = wanted.samples, 4
    scene.cycles.use_denoising = True
    scene.render.use_persistent_data = True


def clip(folder: Path, pictures: list[str]) -> Path:
    """The frames as a moving picture; the folder of the frames if pillow is missing."""
    try:
        from PIL import Image
    except ImportError:
        return folder
    out = folder / "clip.gif"
    frames = [Image.open(picture).convert("RGB") for picture in pictures]
    # One palette for all, and no dithering: still parts do not flicker, and take no space.
    some = Image.fromarray(np.concatenate([np.asarray(frame) for frame in frames[:: len(frames) // 6 + 1]]))
    palette = some.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=3)
    first, *rest = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    first.save(out, save_all=True, append_images=rest, duration=round(1000 / RATE), loop=0, optimize=True)
    return out


if __name__ == "__main__":
    from blender_exit import run_and_leave

    run_and_leave(main)
