# SPDX-License-Identifier: Apache-2.0
"""Make the example of rigged mesh hair: eight locks of four joints, a fringe and a cap on the shipped body, and a short shot.

    python examples/make_mesh_hair.py [-o examples/mesh_hair]

writes `character.usda` (body, hair mesh and hair joints, at rest) and `shot.usda` (the same with a loop of head
and body motion; the hair joints stay at rest), both on top of `examples/shot/body.usdc`. Then:

    neuralocks rig train examples/mesh_hair/character.usda -o hair.neuralocks
    neuralocks rig bake examples/mesh_hair/shot.usda -o baked.usda --model hair.neuralocks
"""

import argparse
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mesh_hair_shapes import Lock, at, cap, curve_of, tube
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.animation.puppet import Puppet
from neuralocks_core.body.collider import Collider
from neuralocks_core.motion import Clip
from usd.assets.animation import write_animation
from usd.assets.prims import author_influences, bind_to
from usd.border.arrays import row_matrices
from usd.border.stage_files import open_stage
from usd.border.units import Border
from usd.skel.joints import JointSource
from usd.skel.source import read_rig

HERE = Path(__file__).resolve().parent

LOCKS = {
    "front_l": Lock((0.004, 0.050), 64, 0.045, 0.22, 0.026, 0.009),
    "front_r": Lock((-0.004, 0.050), -64, 0.045, 0.22, 0.026, 0.009),
    "side_l": Lock((0.006, 0.025), 95, 0.050, 0.25, 0.036, 0.010),
    "side_r": Lock((-0.006, 0.025), -95, 0.050, 0.25, 0.036, 0.010),
    "back_l": Lock((0.006, -0.005), 132, 0.045, 0.28, 0.039, 0.012),
    "back_r": Lock((-0.006, -0.005), -132, 0.045, 0.28, 0.039, 0.012),
    "nape_l": Lock((0.010, -0.030), 165, 0.040, 0.30, 0.038, 0.012),
    "nape_r": Lock((-0.010, -0.030), -165, 0.040, 0.30, 0.038, 0.012),
}
FRINGE = [
    Lock((0.004, 0.068), 42, 0.085, 0.05, 0.022, 0.007),
    Lock((-0.004, 0.068), -42, 0.085, 0.05, 0.022, 0.007),
]
"""Locks on the forehead, too short to swing."""
JOINTS = 4
RATE, SECONDS = 24, 8.0
"""Frame rate and length of the shot."""


def main() -> None:
    """Write both files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--out", type=Path, default=HERE / "mesh_hair")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    make_character(out / "character.usda", HERE / "shot" / "body.usdc")
    make_shot(out / "shot.usda", out / "character.usda")


@dataclass
class Hair:
    """Hair joints and the mesh that they move.

    Attributes:
        names: joint paths, roots of locks below the head.
        parents: index of each joint's parent among the joints of body and hair.
        bind: bind transforms (4, 4), world.
        points: of the mesh (V, 3) [m], world.
        faces: vertex indices of each face.
        indices, weights: joints that move each vertex and their shares, (V, 2).
    """

    names: list[str]
    parents: list[int]
    bind: list[np.ndarray]
    points: np.ndarray
    faces: list[list[int]]
    indices: np.ndarray
    weights: np.ndarray


def make_character(path: Path, body_path: Path) -> None:
    """Body with hair joints and hair mesh, at rest."""
    body_stage = open_stage(body_path)
    skeleton_prim = next(p for p in body_stage.Traverse() if p.IsA(UsdSkel.Skeleton))
    rig = read_rig(body_stage, skeleton_prim, Border.of(body_stage))
    hair = _hair(body_stage, rig.character)
    stage = _layer_over(path, body_path)
    skeleton = UsdSkel.Skeleton(stage.OverridePrim(skeleton_prim.GetPath()))
    _add_joints(skeleton, rig.joints, hair)
    _add_mesh(stage, skeleton, hair)
    stage.GetRootLayer().Save()


def _hair(body_stage, character) -> Hair:
    """The cap, all locks and the fringe."""
    head = character.head
    head_at = character.skeleton.bind[head, :3, 3]
    collider = Collider(character.body.points - head_at, character.body.triangles)
    points, faces = cap(UsdGeom.Mesh(next(p for p in body_stage.Traverse() if p.IsA(UsdGeom.Mesh))), collider, head_at)
    hair = Hair([], [], [], points, faces, *_tied(len(points), head))
    for name, lock in LOCKS.items():
        curve, flats = curve_of(collider, lock)
        first = len(character.skeleton.names) + len(hair.names)
        for i in range(JOINTS):
            hair.names.append(f"{hair.names[-1] if i else character.skeleton.names[head]}/hair_{name}_{i + 1}")
            hair.parents.append(first + i - 1 if i else head)
            hair.bind.append(_bone_frame(*_bone(curve, i), head_at))
        points, faces, along = tube(curve, flats, lock)
        _add(hair, points, faces, *_influences(along, head, first))
    for lock in FRINGE:
        points, faces, _ = tube(*curve_of(collider, lock), lock)
        _add(hair, points, faces, *_tied(len(points), head))
    hair.points = hair.points + head_at
    return hair


def _add(hair: Hair, points, faces, indices, weights) -> None:
    """Add a piece of mesh."""
    hair.faces += [[vertex + len(hair.points) for vertex in face] for face in faces]
    hair.points = np.concatenate([hair.points, points])
    hair.indices = np.concatenate([hair.indices, indices])
    hair.weights = np.concatenate([hair.weights, weights])


def _tied(count, head):
    """Joints and weights (n, 2) of vertices that the head carries."""
    return np.full((count, 2), head), np.tile([1.0, 0.0], (count, 1))


def _add_joints(skeleton: UsdSkel.Skeleton, body: JointSource, hair: Hair) -> None:
    """Append the hair's joints to the body's."""
    bind = np.concatenate([body.bind, hair.bind])
    rest = [*body.rest, *(np.linalg.inv(bind[parent]) @ matrix for parent, matrix in zip(hair.parents, hair.bind))]
    skeleton.GetJointsAttr().Set([*body.names, *hair.names])
    skeleton.GetBindTransformsAttr().Set(row_matrices(bind))
    skeleton.GetRestTransformsAttr().Set(row_matrices(rest))


def _add_mesh(stage, skeleton: UsdSkel.Skeleton, hair: Hair) -> None:
    """The skinned mesh, beside the skeleton."""
    mesh = UsdGeom.Mesh.Define(stage, skeleton.GetPath().GetParentPath().AppendChild("Hair"))
    world = hair.points.astype(np.float32)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(world))
    mesh.CreateFaceVertexCountsAttr([len(f) for f in hair.faces])
    mesh.CreateFaceVertexIndicesAttr([i for f in hair.faces for i in f])
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr([Gf.Vec3f(*map(float, world.min(0))), Gf.Vec3f(*map(float, world.max(0)))])
    mesh.CreateDisplayColorAttr([Gf.Vec3f(0.35, 0.16, 0.10)])
    mesh.CreateDoubleSidedAttr(True)
    author_influences(bind_to(skeleton, mesh.GetPrim(), np.eye(4)), hair.indices, hair.weights)


def make_shot(path: Path, character_path: Path) -> None:
    """The character in motion."""
    source = open_stage(character_path)
    skeleton_prim = next(p for p in source.Traverse() if p.IsA(UsdSkel.Skeleton))
    rig = read_rig(source, skeleton_prim, Border.of(source))
    clip = _motion(rig.character)
    stage = _layer_over(path, character_path)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(len(clip.times))
    stage.SetTimeCodesPerSecond(RATE)
    stage.SetFramesPerSecond(RATE)
    animation = write_animation(stage, skeleton_prim.GetPath().AppendChild("Motion"), rig.character, clip)
    binding = UsdSkel.BindingAPI.Apply(stage.OverridePrim(skeleton_prim.GetPath()))
    binding.CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    stage.GetRootLayer().Save()


def _motion(character) -> Clip:
    """Eight seconds that loop: a nod, a look aside, a shake, a bow and a hop."""
    puppet = Puppet(character, np.arange(int(RATE * SECONDS) + 1) / RATE)
    t = puppet.times

    def bump(start, length):
        x = np.clip((t - start) / length, 0, 1)
        return np.sin(np.pi * x) ** 2

    side, up, front = np.eye(3)
    puppet.turn_neck(np.outer(0.5 * bump(0.2, 1.2), side))
    puppet.turn_neck(np.outer(1.0 * bump(1.2, 1.8), up))
    puppet.turn_neck(np.outer(0.55 * bump(2.9, 1.4) * np.sin(2 * np.pi * 2.5 * (t - 2.9)), up))
    puppet.turn_neck(np.outer(0.35 * bump(4.0, 1.2), front))
    puppet.bend_spine(np.outer(0.7 * bump(4.9, 1.6), side))
    hop = np.clip((t - 6.6) / 0.5, 0, 1)
    puppet.position[:, 1] += 4 * 0.25 * hop * (1 - hop) - 0.06 * (bump(6.2, 0.5) + bump(7.05, 0.5))
    return puppet.clip()


def _layer_over(path: Path, below: Path) -> Usd.Stage:
    """A new layer that sublayers another by relative path and repeats its metadata."""
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    stage.GetRootLayer().subLayerPaths = [os.path.relpath(below, path.parent).replace(os.sep, "/")]
    lower = Usd.Stage.Open(str(below))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.GetStageUpAxis(lower))
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.GetStageMetersPerUnit(lower))
    stage.GetRootLayer().defaultPrim = lower.GetRootLayer().defaultPrim
    return stage


def _bone(curve, i):
    """Start and end of bone i; arc length zero is where the lock leaves the head."""
    length = curve[1][-1]
    return at(curve, length * i / JOINTS), at(curve, length * (i + 1) / JOINTS)


def _bone_frame(begin, end, head_at):
    """Bind transform (4, 4) of a joint whose own Y runs along its bone, as in modelling tools."""
    y = (end - begin) / np.linalg.norm(end - begin)
    x = np.cross(y, [0.0, 0.0, 1.0] if abs(y[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.stack([x, y, np.cross(x, y)], axis=1)
    frame[:3, 3] = begin + head_at
    return frame


def _influences(along, head, first):
    """Joints and weights (n, 2): each joint fades into the next over a third of a bone around the point where they meet."""
    place = along * JOINTS
    bone = np.clip(np.round(place).astype(int), 0, JOINTS - 1)  # the nearest meeting point
    second = np.clip((place - bone) * 1.5 + 0.5, 0, 1)
    before = np.where(bone == 0, head, first + bone - 1)
    after = first + bone
    return np.stack([before, after], axis=1), np.stack([1 - second, second], axis=1)


if __name__ == "__main__":
    main()
