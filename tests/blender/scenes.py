# SPDX-License-Identifier: GPL-3.0-or-later
"""Small Blender scenes with a moving character and hair, made from nothing."""

import math
from unittest.mock import patch

import bpy
import numpy as np

BONES = (
    # name, parent, head, tail: Blender's way round, Z up, looking along -Y, metres.
    ("hips", "", (0, 0, 0.95), (0, 0, 1.1)),
    ("spine", "hips", (0, 0, 1.1), (0, 0, 1.3)),
    ("chest", "spine", (0, 0, 1.3), (0, 0, 1.45)),
    ("neck", "chest", (0, 0.01, 1.45), (0, 0, 1.55)),
    ("head", "neck", (0, 0, 1.55), (0, 0, 1.75)),
    ("shoulder.L", "chest", (0.03, 0, 1.43), (0.15, 0, 1.43)),
    ("upper_arm.L", "shoulder.L", (0.15, 0, 1.43), (0.42, 0, 1.43)),
    ("forearm.L", "upper_arm.L", (0.42, 0, 1.43), (0.67, 0, 1.43)),
    ("shoulder.R", "chest", (-0.03, 0, 1.43), (-0.15, 0, 1.43)),
    ("upper_arm.R", "shoulder.R", (-0.15, 0, 1.43), (-0.42, 0, 1.43)),
    ("forearm.R", "upper_arm.R", (-0.42, 0, 1.43), (-0.67, 0, 1.43)),
)
TAIL = (
    ("hair.01", "head", (0, 0.09, 1.7), (0, 0.14, 1.6)),
    ("hair.02", "hair.01", (0, 0.14, 1.6), (0, 0.15, 1.48)),
)


def empty() -> None:
    """An empty scene at 24 fps, frames 1 to 24, with the add-on's handlers as they are."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps, scene.render.fps_base = 1, 24, 24, 1.0
    scene.frame_set(1)


def armature(name: str = "Rig", bones=BONES):
    """An armature object at the origin, in Object Mode."""
    data = bpy.data.armatures.new(name)
    rig = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for bone, parent, head, tail in bones:
        edit = data.edit_bones.new(bone)
        edit.head, edit.tail = head, tail
        if parent:
            edit.parent = data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in rig.pose.bones:
        bone.rotation_mode = "XYZ"
    return rig


def hair(rig, count: int = 60, vertices: int = 24, parent: bool = True, name: str = "Hair", length: float = 0.25):
    """A Curves object of hanging strands on a head-sized ball."""
    from dcc_addon.scene.hair import curves

    rng = np.random.default_rng(3)
    direction = rng.normal(size=(count, 3))
    direction[:, 2] = np.abs(direction[:, 2])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    s = np.linspace(0, 1, vertices)[None, :, None]
    root = np.array([0, 0, 1.66]) + 0.09 * direction
    points = root[:, None] + length * (s * direction[:, None] * 0.5 + s**2 * np.array([0, 0.1, -0.8]))
    data = curves.create(name, np.full(count, vertices), points.reshape(-1, 3).astype(np.float32))
    result = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(result)
    if parent:
        result.parent = rig
    result.neuralocks_hair.armature = rig
    return result


def body(rig):
    """A coarse skinned body: a tube of vertices per bone, weighted to it."""
    points, faces, groups = [], [], {}
    for bone in rig.data.bones:
        a, b = np.array(bone.head_local), np.array(bone.tail_local)
        radius = 0.08 if bone.name == "head" else 0.05
        first = len(points)
        for t in (0.0, 0.5, 1.0):
            for k in range(8):
                angle = math.tau * k / 8
                side = (
                    np.array([math.cos(angle), math.sin(angle), 0])
                    if abs(b[2] - a[2]) > 0.02
                    else np.array([0, math.cos(angle), math.sin(angle)])
                )
                points.append(a + t * (b - a) + radius * side)
        for ring in range(2):
            for k in range(8):
                i, j = first + 8 * ring + k, first + 8 * ring + (k + 1) % 8
                faces.append((i, j, j + 8, i + 8))
        groups[bone.name] = list(range(first, first + 24))
    mesh = bpy.data.meshes.new("Body")
    mesh.from_pydata([tuple(map(float, p)) for p in points], [], faces)
    skin = bpy.data.objects.new("Body", mesh)
    bpy.context.scene.collection.objects.link(skin)
    for name, members in groups.items():
        skin.vertex_groups.new(name=name).add(members, 1.0, "REPLACE")
    skin.parent = rig
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    return skin


def dancer(count: int = 60, *, skinned: bool = False, **strands):
    """A rig that dances, with its hair, and with a body if wanted; its `hair` has these other arguments."""
    rig = armature()
    if skinned:
        body(rig)
    dance(rig)
    return rig, hair(rig, count, **strands)


def dancer_with_shapes() -> tuple:
    """A dancing rig, alone in the file, with hair and a body with shape keys: held, keyed and driven by the neck."""
    empty()
    rig, _ = dancer(10, skinned=True)
    skin = bpy.data.objects["Body"]
    skin.shape_key_add(name="Basis")
    for name in ("Held", "Keyed", "Driven"):
        block = skin.shape_key_add(name=name)
        for point in block.data:
            point.co.x *= 1.2
    blocks = skin.data.shape_keys.key_blocks
    blocks["Held"].value = 0.5
    for frame in (1, 24):
        blocks["Keyed"].value = frame / 24
        blocks["Keyed"].keyframe_insert("value", frame=frame)
    driver = blocks["Driven"].driver_add("value").driver
    variable, driver.expression = driver.variables.new(), "var"
    variable.type, target = "TRANSFORMS", variable.targets[0]
    target.id, target.bone_target, target.transform_type = rig, "neck", "ROT_X"
    return rig, skin


def dance(rig, frames=(1, 24)) -> None:
    """Key frames: a head shake, a bow and a step."""
    first, last = frames
    for frame in range(first, last + 1, 3):
        t = (frame - first) / 24
        rig.pose.bones["head"].rotation_euler = (0.2 * math.sin(9 * t), 0.9 * math.sin(7 * t), 0.3 * math.sin(2 * t))
        rig.pose.bones["spine"].rotation_euler = (0.3 * math.sin(5 * t), 0.2 * math.sin(3 * t), 0)
        rig.pose.bones["upper_arm.L"].rotation_euler = (0, 0, 0.5 * math.sin(4 * t))
        for bone in ("head", "spine", "upper_arm.L"):
            rig.pose.bones[bone].keyframe_insert("rotation_euler", frame=frame)
        rig.location = (0.3 * t, 0.1 * math.sin(6 * t), 0.05 * math.sin(11 * t))
        rig.keyframe_insert("location", frame=frame)


def collect(name: str) -> None:
    """Put everything in the scene into its own collection."""
    top, own = bpy.context.scene.collection, bpy.data.collections.new(name)
    top.children.link(own)
    for thing in list(top.objects):
        own.objects.link(thing)
        top.objects.unlink(thing)


def points(thing, graph=None) -> np.ndarray:
    """Evaluated points (P, 3) of a Curves object in the world."""
    graph = graph or bpy.context.evaluated_depsgraph_get()
    evaluated = thing.evaluated_get(graph)
    data = evaluated.data
    values = np.empty((len(data.points), 3), np.float32)
    data.attributes["position"].data.foreach_get("vector", values.ravel())
    matrix = np.array(evaluated.matrix_world)
    return values @ matrix[:3, :3].T + matrix[:3, 3]


def constrain(rig) -> None:
    """IK on an arm, a constraint on the head and a driver on the neck, all moving."""
    scene = bpy.context.scene
    target = bpy.data.objects.new("Target", None)
    scene.collection.objects.link(target)
    for frame in (1, 8, 16, 24):
        target.location = (0.5 * math.sin(frame), -0.6, 1.2 + 0.3 * math.cos(frame))
        target.keyframe_insert("location", frame=frame)
    ik = rig.pose.bones["forearm.R"].constraints.new("IK")
    ik.target, ik.chain_count = target, 2
    track = rig.pose.bones["head"].constraints.new("DAMPED_TRACK")
    track.target, track.track_axis, track.influence = target, "TRACK_Z", 0.4
    driver = rig.pose.bones["neck"].driver_add("rotation_euler", 0).driver
    driver.expression = "sin(frame / 4) * 0.3"


def fcurves(thing) -> list:
    """F-curves of an object's active action, in any Blender."""
    return fcurves_of(thing.animation_data.action)


def fcurves_of(action) -> list:
    """F-curves of an action; since 5.0 only through its layers."""
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    return [c for layer in action.layers for strip in layer.strips for bag in strip.channelbags for c in bag.fcurves]


def rig_model(rig, path):
    """A model of random weights for the hair bones of a rig; its graph, for which onnx is needed, is never read."""
    from dcc_addon.services.hair.bones import chains_of
    from dcc_addon.session import session
    from neuralocks_core.rig import rig_spec
    from tests.rig_models import random_rig_model

    sampled = session.rigs[rig.name]
    made = random_rig_model(chains_of(sampled.rig, sampled.character), rig_spec(True), gain=3.0)
    with patch("neuralocks_core.rig.graph.rig_graph", return_value=b"unused"):
        return made.save(path)


def translation(offset):
    """A Blender matrix."""
    from mathutils import Matrix

    return Matrix.Translation(offset)


def surface_deform(hair):
    """The modifier that Blender puts on new hair: curves follow their deformed surface."""
    from dcc_addon.scene.hair.nodes import geometry_nodes

    tree, source, target = geometry_nodes("Surface Deform")
    deform = tree.nodes.new("GeometryNodeDeformCurvesOnSurface")
    tree.links.new(source, deform.inputs[0])
    tree.links.new(deform.outputs[0], target)
    modifier = hair.modifiers.new("Surface Deform", "NODES")
    modifier.node_group = tree
    return modifier
