# SPDX-License-Identifier: GPL-3.0-or-later
"""A face with a rig of its own, whose root bone copies the head of the body's rig."""

import math
from pathlib import Path

import bpy

from dcc_addon.session import session
from tests.blender import scenes
from tests.blender.checks import apart, body_sampled, make_live, messages, points_at

FACE = (
    ("target", "", (0, -0.5, 1.6), (0, -0.5, 1.7)),
    ("face", "", (0, 0, 1.55), (0, 0, 1.75)),
    ("jaw", "face", (0, -0.03, 1.6), (0, -0.1, 1.58)),
)


def beard_on_its_jaw(_folder: Path) -> None:
    """A beard on the jaw of the face's rig stays where it is as it becomes live, wherever the body's rig was moved to."""
    for moved in (0.0, 0.15, 3.0):
        scenes.empty()
        rig, face = _two_rigs(moved)
        beard = scenes.hair(rig, 10, length=0.1, name="Beard")
        beard.parent, beard.parent_type, beard.parent_bone = face, "BONE", "jaw"
        jaw = face.data.bones["jaw"]
        beard.matrix_parent_inverse = (jaw.matrix_local @ scenes.translation((0, jaw.length, 0))).inverted()
        before = points_at(beard, 1)
        make_live(rig, beard, resolve=False)
        roots = [points.reshape(10, -1, 3)[:, 0] for points in (before, points_at(beard, 1))]
        assert apart(*roots) < 1e-4, moved
        told = " ".join(session.rigs["Rig"].hairs_off.values())
        assert "moves up to" in told, "the jaw's own motion is not followed"


def face_mesh(_folder: Path) -> None:
    """A face mesh on the face's rig is told not to be part of the body; chosen as the body, it goes with the head, whatever else the
    face's rig follows.
    """
    rig, face = _two_rigs(0.0)
    follow = face.pose.bones["target"].constraints.new("COPY_TRANSFORMS")
    follow.target, follow.subtarget = rig, "hips"
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.12, location=(0, 0, 1.66))
    mesh = bpy.context.object
    mesh.name = "FaceMesh"
    mesh.vertex_groups.new(name="face").add(range(len(mesh.data.vertices)), 1.0, "REPLACE")
    mesh.modifiers.new("Armature", "ARMATURE").object = face
    strands = scenes.hair(rig, 20)
    make_live(rig, strands)
    (note,) = session.rigs["Rig"].bodies_off
    assert note.startswith("FaceMesh: Face, which follows the bone 'head', deforms it,"), note
    rig.neuralocks_character.body = mesh
    body_sampled(rig, mesh)
    sampled = session.rigs["Rig"]
    assert sampled.bodies == ("FaceMesh",) and not sampled.bodies_off and not messages(), messages()


def deforming_rig(_folder: Path) -> None:
    """A body on a rig of its own, each bone of which copies the one of that name, is weighted as there."""
    rig = scenes.armature()
    scenes.dance(rig)
    other = scenes.armature("Deform")
    skin = scenes.body(other)
    for bone in other.pose.bones:
        follow = bone.constraints.new("COPY_TRANSFORMS")
        follow.target, follow.subtarget = rig, bone.name
    rig.neuralocks_character.body = skin
    bpy.context.scene.neuralocks.armature = rig
    body_sampled(rig, skin)


def _two_rigs(moved: float) -> tuple:
    """The body's rig, which nods at a place `moved` along X, and the face's at the origin, whose jaw opens."""
    rig, face = scenes.armature(), scenes.armature("Face", FACE)
    scenes.body(rig)
    rig.location = (moved, 0, 0)
    for frame in range(1, 25, 4):
        for thing, turn in ((rig.pose.bones["head"], 0.2), (face.pose.bones["jaw"], 0.1)):
            thing.rotation_euler = (turn * (1 + math.sin(frame)), 0, 0)
            thing.keyframe_insert("rotation_euler", frame=frame)
    follow = face.pose.bones["face"].constraints.new("COPY_TRANSFORMS")
    follow.target, follow.subtarget = rig, "head"
    return rig, face
