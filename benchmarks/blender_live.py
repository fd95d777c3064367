# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair in Blender at several sizes, and in the shipped shot; `blender_dynamics.py` compares it with Blender's own.

    .venv-blender-5.2/bin/python benchmarks/blender_live.py MODEL

Prints milliseconds per frame (median of sequential frames) for all of `scene.frame_set`. Without MODEL, the shipped model is
used. Times are wall-clock time, so run it on an idle machine, or on a busy one with --cpu-time, which counts the processor
time of all threads. Strands have 24 vertices, unevenly spaced, as in other people's grooms. The shipped shot has a skinned
body that the hair is kept out of; sampling its motion and playing it take turns.
"""

import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

try:
    import bpy
except ModuleNotFoundError:
    sys.exit("blender_live: needs a Python with bpy, such as .venv-blender-5.2/bin/python (make blender)")
import numpy as np

clock = time.process_time if "--cpu-time" in sys.argv else time.perf_counter
FRAMES = 40


def main() -> None:
    """Measure three sizes, then the shipped shot."""
    import dcc_addon
    from tests.blender import scenes

    model = next((word for word in sys.argv[1:] if not word.startswith("-")), "")
    dcc_addon.register()
    print(f"Blender {bpy.app.version_string}, {os.cpu_count()} cores")
    for count in (3000, 50000, 120000):
        found = live(scenes, model, count)
        rate = ", ".join(f"{name} {value:.2f}" for name, value in found.items())
        print(f"live, {count} strands x 24: {rate} [ms]", flush=True)
    for name, value in shipped_shot(scenes, model).items():
        print(f"shipped shot, {name}: {value:.2f}", flush=True)


def live(scenes, model: str, count: int) -> dict[str, float]:
    """Median time of a frame with live hair and without it."""
    scenes.empty()
    scene = bpy.context.scene
    scene.frame_end = FRAMES
    rig = scenes.armature()
    scenes.dance(rig, (1, FRAMES))
    hair = scenes.hair(rig, count)
    scene.neuralocks.armature, scene.neuralocks.hair = rig, hair
    hair.neuralocks_hair.model = model
    bpy.context.view_layer.update()  # from now on a frame has something to evaluate
    plain = median(scene, FRAMES)
    bpy.ops.neuralocks.sample_motion()
    hair.neuralocks_hair.live = True
    for frame in (1, 2):
        scene.frame_set(frame)
    result = {"live": median(scene, FRAMES), "without": plain}
    from dcc_addon.session import session

    assert not session.said.messages, session.said.messages
    hair.neuralocks_hair.live = False
    return result


def shipped_shot(scenes, model: str) -> dict[str, float]:
    """The shipped shot: frames without live hair, with it, with it kept out of the body; sampling against playing."""
    from examples import blender_shot

    scenes.empty()
    scene = bpy.context.scene
    _, _, hair = blender_shot.build()
    bpy.ops.neuralocks.assign()
    frames = range(scene.frame_start, scene.frame_end + 1)
    playing, sampling = [], []
    for _ in range(5):
        began = clock()
        for frame in frames:
            scene.frame_set(frame)
        played = clock()
        bpy.ops.neuralocks.sample_motion()
        sampling.append(clock() - played)
        playing.append(played - began)
    result = {"playing [ms]": median(scene, FRAMES)}
    own = hair.neuralocks_hair
    own.model, own.resolve, own.live = model, False, True
    result["live [ms]"] = median(scene, FRAMES)
    own.resolve = True
    scene.frame_set(frames[0])
    result["live, kept out of the body [ms]"] = median(scene, FRAMES)
    own.live = False
    return result | {"sampling, times playing": min(sampling) / min(playing)}


def median(scene, frames: int) -> float:
    """Milliseconds per frame when stepping through the frames in order."""
    spent = []
    for frame in range(1, frames + 1):
        began = clock()
        scene.frame_set(frame)
        spent.append(clock() - began)
    return 1e3 * float(np.median(spent[1:]))


if __name__ == "__main__":
    from examples.blender_exit import run_and_leave

    run_and_leave(main)
