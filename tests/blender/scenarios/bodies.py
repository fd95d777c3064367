# SPDX-License-Identifier: GPL-3.0-or-later
"""Body meshes as artists build them."""

from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import bmesh
import bpy
import numpy as np

from dcc_addon.scene.character import binding
from dcc_addon.session import session
from tests.blender import scenes
from tests.blender.checks import SAME, apart, baked_points, body_sampled, choose, make_live, points_at, refused


def body_as_drawn(_folder: Path) -> None:
    """The body that hair is kept out of is the one that Blender draws: with half of it from a mirror modifier, shape keys limited
    to a vertex group, groups named like bones that deform nothing, and weights of groups that do not exist.
    """
    scene, rig = bpy.context.scene, scenes.armature(bones=(*scenes.BONES, ("scalp", "head", (0, 0.5, 1), (0, 0.6, 1))))
    rig.data.bones["scalp"].use_deform = False
    scenes.dance(rig)
    body, strands = scenes.body(rig), scenes.hair(rig, 4)
    scene.neuralocks.armature, scene.neuralocks.hair = rig, strands

    mesh, right = body.data, {v.index for v in body.data.vertices if v.co.x < -0.01}
    everything = list(range(len(mesh.vertices)))
    body.vertex_groups.new(name="scalp").add(everything, 0.5, "REPLACE")
    upper = [v.index for v in mesh.vertices if v.co.z > 1.4]
    body.vertex_groups.new(name="upper").add(upper, 0.7, "REPLACE")
    body.shape_key_add(name="Basis")
    key = body.shape_key_add(name="wide")
    for point in key.data:
        point.co.x *= 1.5
    key.vertex_group, key.value = "upper", 0.8
    body_sampled(rig, body)

    bpy.context.view_layer.objects.active = body
    half_of = bmesh.new()
    half_of.from_mesh(body.data)
    bmesh.ops.delete(half_of, geom=[v for v in half_of.verts if v.index in right], context="VERTS")
    weights = half_of.verts.layers.deform.verify()
    for vertex in half_of.verts:
        vertex[weights][77] = 1.0
    half_of.to_mesh(body.data)
    half_of.free()
    half = len(body.data.vertices)
    assert half < len(everything)
    mirror = body.modifiers.new("Mirror", "MIRROR")
    while body.modifiers[0] != mirror:
        bpy.ops.object.modifier_move_up(modifier=mirror.name)
    assert body_sampled(rig, body) > half
    mirror.use_mirror_merge = False
    mirror.mirror_object = bpy.data.objects.new("Middle", None)
    scene.collection.objects.link(mirror.mirror_object)
    mirror.mirror_object.parent, mirror.mirror_object.location = rig, (0.02, 0, 0)
    assert body_sampled(rig, body) == 2 * half
    mirror.mirror_object.scale = (1, 1, 0)
    refused(bpy.ops.neuralocks.sample_motion, "'Mirror' mirrors it in 'Middle', and one of both has zero scale")


def mirror_object_moved(folder: Path) -> None:
    """Moving the object in which a body is mirrored makes the motion out of date, and the next render samples it again. A bake keeps
    hair out of the same body as the live view if the character moves and that object does not.
    """
    from dcc_addon import background, handlers

    scene, rig = bpy.context.scene, scenes.armature()
    scenes.dance(rig)
    body, strands = scenes.body(rig), scenes.hair(rig, 4)
    mirror, middle = body.modifiers.new("Mirror", "MIRROR"), bpy.data.objects.new("Middle", None)
    scene.collection.objects.link(middle)
    mirror.mirror_object, mirror.use_mirror_merge = middle, False
    choose(body)
    bpy.ops.object.modifier_move_to_index(modifier="Mirror", index=0)
    bpy.context.view_layer.update()
    make_live(rig, strands)
    scene.frame_set(9)

    def render():
        handlers.before_render(scene)
        handlers.after_render()
        return session.rigs["Rig"]

    before = render()
    assert before is render()
    bpy.context.view_layer.update()
    with patch("dcc_addon.handlers.background.doubt", wraps=background.doubt) as doubted:
        middle.location.x = 0.1
        bpy.context.view_layer.update()
    after = render()
    assert doubted.called and before.stale and not after.stale
    moved = after.character.body.points - before.character.body.points
    assert np.isclose(np.abs(moved).max(), 0.2, atol=1e-5)
    mirror.use_axis = False, True, False
    bpy.context.view_layer.update()
    assert render() is not after and after.stale
    live = points_at(strands, 9)
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "out.usdc")) == {"FINISHED"}
    assert apart(baked_points(folder / "out.usdc", "/Character/Hair_Hair", 9), live) < SAME


def absolute_shape_keys(_folder: Path) -> None:
    """Absolute shape keys, which only time blends, without groups and values, deform the body as drawn."""
    rig = scenes.armature()
    scenes.dance(rig)
    body = scenes.body(rig)
    bpy.context.scene.neuralocks.armature = rig
    body.shape_key_add(name="Basis")
    for number, name in enumerate(("wide", "tall", "deep")):
        for point in body.shape_key_add(name=name).data:
            point.co[number] *= 1.3
    keys = body.data.shape_keys
    keys.key_blocks["tall"].vertex_group, keys.key_blocks["tall"].mute = "head", True
    keys.key_blocks["deep"].relative_key = keys.key_blocks["wide"]
    keys.use_relative = False
    for frame, time in ((1, 4.0), (9, 27.0), (12, 99.0)):
        keys.eval_time = time
        keys.keyframe_insert("eval_time", frame=frame)
    body_sampled(rig, body)
    sampled = session.rigs["Rig"]
    assert np.allclose(sampled.clip.shape_at([sampled.clip.times[-1]]), [0, 0, 1])


def rigid_bodies(_folder: Path) -> None:
    """A chosen body that rides on a bone as a whole moves with it, by whatever constraint; one that only turns towards a
    bone does not ride on it.
    """
    rig = scenes.armature()
    scenes.dance(rig)
    bpy.context.scene.neuralocks.armature = rig
    bpy.ops.mesh.primitive_cube_add(size=0.2)
    skull = bpy.context.object
    rig.neuralocks_character.body = skull

    def constrained(kind, bone):
        constraint = skull.constraints.new(kind)
        constraint.target, constraint.subtarget = rig, bone

    def rides(*weights):
        skull.parent, constraint = rig, skull.constraints.new("ARMATURE")
        for bone, weight in weights:
            target = constraint.targets.new()
            target.target, target.subtarget, target.weight = rig, bone, weight

    for place, ride in (
        ((0, 0, 0), lambda: constrained("COPY_TRANSFORMS", "head")),
        ((0, 0, 0), lambda: (constrained("COPY_LOCATION", "head"), constrained("COPY_ROTATION", "head"))),
        ((0, 0, 1.66), lambda: rides(("head", 1.0))),
        ((0, 0, 1.66), lambda: rides(("spine", 0.0), ("head", 1.0))),
    ):
        skull.constraints.clear()
        skull.location = place
        ride()
        body_sampled(rig, skull)
    skull.constraints.clear()
    constrained("DAMPED_TRACK", "upper_arm.L")
    assert binding.carrying_bone(skull, rig) is None
    rides(("head", 1.0))
    assert binding.carrying_bone(skull, rig) == "head"


def weighted_elsewhere(_folder: Path) -> None:
    """A chosen body that no bone of the character moves gets a note, with the rig that moves it; one that moves with bones of the
    same names, or rides on one, does not.
    """
    from dcc_addon.interface.panels import findings
    from dcc_addon.operators.character import NEURALOCKS_OT_check

    control = scenes.armature("Control", [(f"c_{n}", p and f"c_{p}", *ends) for n, p, *ends in scenes.BONES])
    game, twin, said = scenes.armature("Game"), scenes.armature("Twin"), []
    skin = scenes.body(game)
    operator = SimpleNamespace(report=lambda kind, text: said.append(text))

    def told(armature, body) -> str:
        bpy.context.scene.neuralocks.armature, armature.neuralocks_character.body = armature, body
        said.clear()
        NEURALOCKS_OT_check.work(operator, bpy.context)
        lines, problem = findings(armature)
        assert lines and said == ([problem] if problem else []), (said, problem)
        return problem

    assert not any(told(*pair) for pair in ((game, skin), (twin, skin), (control, None)))
    assert "Body" in told(control, skin) and "choose Game as the character" in told(control, skin)
    bpy.ops.mesh.primitive_cube_add(size=0.2)
    stone = bpy.context.object
    assert "choose another body" in told(game, stone)
    stone.parent, stone.parent_type, stone.parent_bone = game, "BONE", "head"
    assert not told(game, stone)
    for bone in game.data.bones:
        bone.use_deform = False
    assert "deforming bone" in told(game, skin) and not told(twin, skin)


def no_faces(folder: Path) -> None:
    """A mesh that gets its faces only from modifiers, and that the armature deforms, does not prevent a bake."""
    rig = scenes.armature()
    scenes.dance(rig)
    body, strands = scenes.body(rig), scenes.hair(rig, 10)
    empty = bpy.data.objects.new("Aaa", bpy.data.meshes.new("Aaa"))
    bpy.context.scene.collection.objects.link(empty)
    empty.modifiers.new("Armature", "ARMATURE").object = rig
    make_live(rig, strands)
    assert session.rigs["Rig"].bodies == (body.name,)
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "out.usdc")) == {"FINISHED"}
    rig.neuralocks_character.body = empty
    refused(bpy.ops.neuralocks.sample_motion, "Aaa: it has no faces")


def hair_on_a_face(folder: Path) -> None:
    """Hair rides on skin that a shape key moves, by as much in the viewport as in a bake; without the key it is as it was."""
    rig = scenes.armature()
    scenes.dance(rig)
    body, strands = scenes.body(rig), scenes.hair(rig, 20)
    body.shape_key_add(name="Basis")
    frown = body.shape_key_add(name="Frown")
    head = body.vertex_groups["head"].index
    for vertex, point in zip(body.data.vertices, frown.data):
        if any(group.group == head for group in vertex.groups):
            point.co.z -= 0.02
    for frame in (1, 24):
        frown.value = (frame - 1) / 23
        frown.keyframe_insert("value", frame=frame)
    make_live(rig, strands)
    moved = {frame: points_at(strands, frame) for frame in (1, 12, 24)}
    values = {}
    for frame in moved:
        bpy.context.scene.frame_set(frame)
        values[frame] = frown.value
    assert bpy.ops.neuralocks.bake(filepath=str(folder / "face.usdc")) == {"FINISHED"}
    for frame, points in moved.items():
        assert apart(baked_points(folder / "face.usdc", "/Character/Hair_Hair", frame), points) < SAME, frame
    frown.mute = True
    assert bpy.ops.neuralocks.sample_motion() == {"FINISHED"}
    for frame, points in moved.items():
        roots = np.linalg.norm((points - points_at(strands, frame)).reshape(20, -1, 3)[:, 0], axis=1)
        assert np.allclose(roots.max(), 0.02 * values[frame], atol=1e-5), (frame, roots)
