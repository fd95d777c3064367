# SPDX-License-Identifier: Apache-2.0
"""Small rigs with mesh hair for tests, in any unit and up axis, and models for them."""

from pathlib import Path

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.rig import RigModel, rig_spec
from usd.rig.stage import BAKED

from ..rig_models import random_rig_model

EXAMPLE = Path(__file__).parents[2] / "examples" / "mesh_hair"


def model_for(hair, dynamic=False) -> RigModel:
    """Random weights for the chains of a stage."""
    return random_rig_model(hair.rig.chains, rig_spec(dynamic), gain=0.4)


def small_shot(
    path,
    scale=1.0,
    z_up=False,
    rate=24,
    frames=24,
    head_moves=True,
    bind=True,
    weights=1.0,
    orient=None,
    step=0.07,
    mirrored=6,
) -> Path:
    """A head with one tail of three joints and an end, nodding; in any unit and up axis, with the hair's axes turned by
    `orient` (3, 3), its joints `step` [m] below each other. Joint `mirrored` and those below it have a negative scale, which moves
    nothing, in the bind pose, at rest and in the animation.
    """
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1 / scale)
    UsdGeom.SetStageUpAxis(stage, "Z" if z_up else "Y")
    stage.SetTimeCodesPerSecond(rate)
    root = UsdSkel.Root.Define(stage, "/Who")
    stage.SetDefaultPrim(root.GetPrim())
    skeleton = UsdSkel.Skeleton.Define(stage, "/Who/Rig")
    joints = ["hips", "hips/head"]
    places = [(0, 1, 0), (0, 1.5, 0)]
    for i in range(4):
        joints.append(f"{joints[-1]}/hair_{i}")
        places.append((0, 1.55 - step * i, -0.1 - 0.02 * i))
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) if z_up else np.eye(3)
    world = [np.block([[turn, (scale * turn @ np.array(p))[:, None]], [np.zeros(3), 1]]) for p in places]
    for hair in world[2:]:
        hair[:3, :3] = hair[:3, :3] @ (np.eye(3) if orient is None else orient)
    for joint in world[mirrored:]:
        joint[:3, 0] *= -1

    def rows(matrices):
        return Vt.Matrix4dArray([Gf.Matrix4d(*np.asarray(m).T.ravel().tolist()) for m in matrices])

    local = [world[0]] + [np.linalg.inv(a) @ b for a, b in zip(world, world[1:])]
    skeleton.CreateJointsAttr(joints)
    if bind:
        skeleton.CreateBindTransformsAttr(rows(world))
    skeleton.CreateRestTransformsAttr(rows(local))
    mesh = UsdGeom.Mesh.Define(stage, "/Who/Hair")
    points = np.repeat(np.array(places[2:5]), 3, axis=0) + np.tile(0.01 * np.eye(3), (3, 1))
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy((scale * points @ turn.T).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([3, 3, 3])
    mesh.CreateFaceVertexIndicesAttr(list(range(9)))
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateJointIndicesPrimvar(False, 1).Set([2] * 3 + [3] * 3 + [4] * 3)
    binding.CreateJointWeightsPrimvar(False, 1).Set([weights] * 9)
    motion = UsdSkel.Animation.Define(stage, "/Who/Motion")
    motion.CreateJointsAttr(joints)
    motion.CreateScalesAttr([Gf.Vec3h(-1 if joint == mirrored else 1, 1, 1) for joint in range(6)])
    motion.CreateTranslationsAttr([Gf.Vec3f(*map(float, m[:3, 3])) for m in local])
    motion.CreateRotationsAttr()
    for frame in range(frames + 1):
        angle = 0.5 * np.sin(2 * np.pi * frame / frames) if head_moves else 0.0
        turns = [Gf.Quatf(1)] * 6
        first = Gf.Quatf(*map(float, (np.cos(np.pi / 4), np.sin(np.pi / 4), 0, 0))) if z_up else Gf.Quatf(1)
        turns[0] = first
        turns[1] = Gf.Quatf(float(np.cos(angle / 2)), float(np.sin(angle / 2)), 0, 0)
        motion.GetRotationsAttr().Set(turns, frame + 1)
    motion.CreateBlendShapesAttr(["smile"])
    motion.CreateBlendShapeWeightsAttr().Set([0.25], 3)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([motion.GetPath()])
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(frames + 1)
    stage.GetRootLayer().Save()
    return path


def hair_turns(path, codes, who="Who") -> np.ndarray:
    """Rotations (T, 3, 4) wxyz that a bake gives the three moving joints of a small shot's character."""
    stage = Usd.Stage.Open(str(path))
    animation = UsdSkel.Animation(stage.GetPrimAtPath(f"/{who}/Rig/{BAKED}"))
    return np.array([rotations(animation, code)[2:5] for code in codes])


def rotations(animation: UsdSkel.Animation, code) -> np.ndarray:
    """(J, 4) wxyz of an animation at a time code."""
    return np.array([(q.GetReal(), *q.GetImaginary()) for q in animation.GetRotationsAttr().Get(code)])
