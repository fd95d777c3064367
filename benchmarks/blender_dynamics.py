# SPDX-License-Identifier: GPL-3.0-or-later
"""Live hair beside Blender's own hair dynamics, on the same strands and the same motion.

    .venv-blender-4.5/bin/python benchmarks/blender_dynamics.py MODEL      beside particle hair dynamics
    .venv-blender-5.2/bin/python benchmarks/blender_dynamics.py MODEL      beside the "Hair Dynamics" asset (XPBD)

3,000 straight strands of 24 vertices and 0.2 m are on a ball, the head of an armature that moves by 8 cm and turns by
0.6. Both solvers run at their defaults, without a collider, and our hair is not kept out of the ball either. Prints
milliseconds per frame, all of `scene.frame_set` (median of sequential frames), and the length of the strands at the
last frame. Without MODEL, the shipped model is used. Times are wall-clock time: run it on an idle machine.
"""

import math
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

try:
    import bpy
except ModuleNotFoundError:
    sys.exit("blender_dynamics: needs a Python with bpy, such as .venv-blender-5.2/bin/python (make blender)")
import numpy as np

COUNT, VERTICES, LENGTH, RADIUS = 3000, 24, 0.2, 0.1
FRAMES = 40
SLOW_FRAMES = 12


def main() -> None:
    """Measure this Blender's own dynamics, then ours in the same scene."""
    import dcc_addon

    dcc_addon.register()
    print(f"Blender {bpy.app.version_string}, {os.cpu_count()} cores; {COUNT} strands x {VERTICES}")
    if bpy.app.version >= (5, 2):
        hair, name = xpbd(), "Hair Dynamics (XPBD)"
    else:
        hair, name = particles(), "particle hair dynamics"
    theirs = _measured(name, hair, SLOW_FRAMES)
    rig = bpy.context.scene.objects["Rig"]
    hair = _without_dynamics(hair)
    ours = _measured("neuralocks live", _live(hair, rig, "".join(sys.argv[1:2])), FRAMES)
    print(f"{name} takes {theirs / ours:.0f} times as long as live hair")


def _head() -> tuple:
    """An armature that moves, and a ball on its head."""
    from tests.blender import scenes

    scenes.empty()
    bpy.context.scene.frame_end = FRAMES
    rig = scenes.armature()
    for frame in range(1, FRAMES + 1, 4):
        rig.location = (0.08 * math.sin(frame / 3), 0, 0)
        rig.rotation_euler = (0, 0, 0.6 * math.sin(frame / 4))
        rig.keyframe_insert("location", frame=frame)
        rig.keyframe_insert("rotation_euler", frame=frame)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=RADIUS, location=(0, 0, 1.66))
    ball = bpy.context.active_object
    ball.parent = rig
    return rig, ball


def particles():
    """The ball with particle hair, dynamic at its default quality."""
    _, ball = _head()
    ball.modifiers.new("Hair", "PARTICLE_SYSTEM")
    system = ball.particle_systems[0]
    system.settings.type, system.settings.count = "HAIR", COUNT
    system.settings.hair_length, system.settings.hair_step = LENGTH, VERTICES - 1
    system.use_hair_dynamics = True
    return ball


def xpbd():
    """Hair curves with the asset of Blender 5.2, in its mode Physics with default steps."""
    from dcc_addon.scene.hair import curves

    rig, ball = _head()
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(COUNT, 1, 3))
    direction /= np.linalg.norm(direction, axis=2, keepdims=True)
    points = np.array(ball.location) + direction * (RADIUS + LENGTH * np.linspace(0, 1, VERTICES)[None, :, None])
    data = curves.create("Hair", np.full(COUNT, VERTICES), points.reshape(-1, 3).astype(np.float32))
    data.surface = ball
    data.surface_uv_map = ball.data.uv_layers.active.name
    hair = bpy.data.objects.new("Hair", data)
    bpy.context.scene.collection.objects.link(hair)
    hair.parent = rig
    bpy.context.view_layer.objects.active = hair
    bpy.ops.curves.snap_curves_to_surface(attach_mode="NEAREST")
    assets = Path(bpy.utils.system_resource("DATAFILES")) / "assets"
    library = next(assets.rglob("geometry_nodes_dynamics_assets.blend"))
    with bpy.data.libraries.load(str(library)) as (_, wanted):
        wanted.node_groups = ["Hair Dynamics"]
    modifier = hair.modifiers.new("Dynamics", "NODES")
    modifier.node_group = wanted.node_groups[0]
    for item in modifier.node_group.interface.items_tree:
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.socket_type == "NodeSocketMenu":
            value = getattr(modifier.properties.inputs, item.identifier)
            try:
                value.value = "Physics (Experimental)"
            except TypeError:
                continue
    return hair


def _without_dynamics(hair):
    """The same strands as curves that nothing else moves."""
    if hair.type == "CURVES":
        hair.modifiers.clear()
        return hair
    bpy.ops.neuralocks.from_particles()
    hair.modifiers.clear()
    return bpy.context.scene.neuralocks.hair


def _live(hair, rig, model: str):
    """Make hair live on an armature."""
    from dcc_addon.session import session

    scene = bpy.context.scene
    scene.neuralocks.armature, scene.neuralocks.hair = rig, hair
    bpy.ops.neuralocks.assign()
    hair.neuralocks_hair.model, hair.neuralocks_hair.resolve = model, False
    hair.neuralocks_hair.live = True
    bpy.ops.neuralocks.sample_motion()
    for frame in (1, 2):
        scene.frame_set(frame)
    assert not session.said.messages, session.said.messages
    return hair


def _measured(name: str, hair, frames: int) -> float:
    """Print and return milliseconds per frame."""
    from benchmarks.blender_live import median

    found = median(bpy.context.scene, frames)
    print(f"{name}: {found:.2f} ms a frame; strands are {_length(hair):.3f} m long, groomed {LENGTH} m", flush=True)
    return found


def _length(hair) -> float:
    """Mean length of the strands as displayed [m]."""
    graph = bpy.context.evaluated_depsgraph_get()
    shown = hair.evaluated_get(graph)
    if hair.type == "CURVES":
        points = np.empty(len(shown.data.points) * 3, np.float32)
        shown.data.attributes["position"].data.foreach_get("vector", points)
        strands = points.reshape(COUNT, -1, 3)
    else:
        system = shown.particle_systems[0]
        strands = np.array([[key.co for key in particle.hair_keys] for particle in system.particles])
    return float(np.linalg.norm(np.diff(strands, axis=1), axis=2).sum(axis=1).mean())


if __name__ == "__main__":
    from examples.blender_exit import run_and_leave

    run_and_leave(main)
