# SPDX-License-Identifier: GPL-3.0-or-later
"""The shipped shot as a Blender scene: armature with its animation, body and hair, through the add-on's own functions.

Works in every Blender that the add-on supports, even if Blender itself cannot read USD.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import bpy
import numpy as np
from mathutils import Matrix

SHOT = ROOT / "examples" / "shot" / "shot.usda"
COLLAR = -0.25
"""Height over the middle of the head [m] below which the body is dressed."""


def build(shot_path=SHOT, strands: int | None = None):
    """Fill the current scene; returns (armature, body, hair objects)."""
    from usd.shot.stage import read_shot

    shot = read_shot(shot_path)
    rig = shot.rigs[0]
    up = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = int(shot.first), int(shot.last)
    scene.render.fps, scene.render.fps_base = round(shot.border.rate), 1.0
    names = [name.rsplit("/", 1)[-1] for name in rig.character.skeleton.names]
    armature = _armature(names, rig, up)
    _animate(armature, names, rig, up)
    body = _body(armature, names, rig, up)
    hair = _hair(armature, shot.grooms[0], up, strands)
    scene.neuralocks.armature, scene.neuralocks.hair = armature, hair
    return armature, body, hair


def _armature(names, rig, up):
    data = bpy.data.armatures.new("Character")
    armature = bpy.data.objects.new("Character", data)
    bpy.context.scene.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    bind = up @ rig.character.skeleton.bind
    for name, parent, matrix in zip(names, rig.character.skeleton.parents, bind, strict=True):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = (0, 0, 0), (0, 0.05, 0)
        bone.matrix = Matrix(matrix.tolist())
        if parent >= 0:
            bone.parent = data.edit_bones[names[parent]]
    bpy.ops.object.mode_set(mode="OBJECT")
    return armature


def _animate(armature, names, rig, up):
    """Keys on every bone: basis = rest^-1 local, with locals taken from the world transforms of the clip."""
    bind, world = up @ rig.character.skeleton.bind, up @ rig.clip.joints
    parents = rig.character.skeleton.parents
    action = bpy.data.actions.new("Shot")
    armature.animation_data_create().action = action
    if hasattr(action, "slots"):
        slot = action.slots.new("OBJECT", armature.name)
        bag = action.layers.new("Layer").strips.new(type="KEYFRAME").channelbag(slot, ensure=True)
        armature.animation_data.action_slot, curves = slot, bag.fcurves
    else:
        curves = action.fcurves
    for joint, (name, parent) in enumerate(zip(names, parents, strict=True)):
        rest = bind[joint] if parent < 0 else np.linalg.inv(bind[parent]) @ bind[joint]
        local = world[:, joint] if parent < 0 else np.linalg.inv(world[:, parent]) @ world[:, joint]
        basis = [Matrix(m.tolist()) for m in np.linalg.inv(rest) @ local]
        turns = [m.to_quaternion() for m in basis]
        for before, turn in zip(turns, turns[1:]):
            turn.make_compatible(before)
        armature.pose.bones[name].rotation_mode = "QUATERNION"
        values = {"location": np.array([m.to_translation() for m in basis]), "rotation_quaternion": np.array(turns)}
        for channel, rows in values.items():
            for index in range(rows.shape[1]):
                curve = curves.new(f'pose.bones["{name}"].{channel}', index=index)
                curve.keyframe_points.add(len(rows))
                keys = np.stack([rig.time_codes, rows[:, index]], axis=1)
                curve.keyframe_points.foreach_set("co", keys.ravel())
                curve.update()


def _body(armature, names, rig, up):
    source = rig.character.body
    mesh = bpy.data.meshes.new("Body")
    mesh.from_pydata((source.points @ up[:3, :3].T).tolist(), [], source.triangles.tolist())
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    body = bpy.data.objects.new("Body", mesh)
    bpy.context.scene.collection.objects.link(body)
    groups = [body.vertex_groups.new(name=name) for name in names]
    for vertex, (joints, weights) in enumerate(
        zip(source.joint_indices.tolist(), source.joint_weights.tolist(), strict=True)
    ):
        for joint, weight in zip(joints, weights, strict=True):
            if weight > 0:
                groups[joint].add([vertex], weight, "REPLACE")
    body.parent = armature
    body.modifiers.new("Armature", "ARMATURE").object = armature
    middle = rig.character.canonical_to_bind[1, 3] + rig.character.head_centre[1]
    height = mesh.attributes.new("height", "FLOAT", "POINT")
    height.data.foreach_set("value", (source.points[:, 1] - middle - COLLAR + 0.5).astype(np.float32))
    mesh.materials.append(_skin())
    return body


def _hair(armature, item, up, strands):
    from dcc_addon.scene.hair import curves

    groom = item.groom
    if strands and strands < groom.strand_count:
        groom = groom.subset(np.linspace(0, groom.strand_count - 1, strands).astype(int))
    points = (groom.points @ up[:3, :3].T).astype(np.float32)
    data = curves.create("Hair", groom.counts, points, groom.widths / 2, _hair_material())
    hair = bpy.data.objects.new("Hair", data)
    bpy.context.scene.collection.objects.link(hair)
    hair.parent = armature
    hair.neuralocks_hair.armature = armature
    return hair


def _material(name, colour, roughness):
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):  # later ones always do
        material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = colour
    shader.inputs["Roughness"].default_value = roughness
    material.diffuse_color = colour
    return material


def _skin():
    """Skin above the collar, dark cloth below: the attribute `height` is one half at the collar."""
    material = _material("Skin", (0.52, 0.30, 0.22, 1), 0.45)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = next(n for n in nodes if n.type == "BSDF_PRINCIPLED")
    height, ramp = nodes.new("ShaderNodeAttribute"), nodes.new("ShaderNodeValToRGB")
    height.attribute_name = "height"
    ramp.color_ramp.interpolation = "CONSTANT"
    cloth, skin = ramp.color_ramp.elements
    cloth.color, skin.color, skin.position = (0.018, 0.022, 0.032, 1), material.diffuse_color, 0.5
    links.new(height.outputs["Fac"], ramp.inputs["Fac"])
    links.new(ramp.outputs["Color"], shader.inputs["Base Color"])
    return material


def _hair_material():
    material = _material("Hair", (0.20, 0.075, 0.03, 1), 0.55)
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    if "Anisotropic" in shader.inputs:
        shader.inputs["Anisotropic"].default_value = 0.6
    material.diffuse_color = (0.30, 0.13, 0.06, 1)
    _fibres(material.node_tree)
    return material


def _fibres(tree) -> None:
    """Translucent hair for Cycles; other engines do not support its shader, and keep the plain one."""
    plain = next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL")
    plain.target = "EEVEE"
    fibre, output = tree.nodes.new("ShaderNodeBsdfHairPrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
    output.target, fibre.parametrization = "CYCLES", "MELANIN"
    values = {"Melanin": 0.6, "Melanin Redness": 0.7, "Roughness": 0.3, "Radial Roughness": 0.45, "Random Color": 0.2}
    for name, value in values.items():
        fibre.inputs[name].default_value = value
    tree.links.new(fibre.outputs[0], output.inputs["Surface"])
