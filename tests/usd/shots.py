# SPDX-License-Identifier: Apache-2.0
"""Small shots for tests: one humanoid with a head of hair, written in any unit, up axis and nesting; bakes read back."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from usd.border.stage_files import open_stage

JOINTS = (
    "hips", "hips/spine", "hips/spine/neck", "hips/spine/neck/head",
    "hips/spine/arm_L", "hips/spine/arm_R", "hips/spine/arm_L/elbow_L", "hips/spine/arm_R/elbow_R",
)  # fmt: skip
PARENTS = (-1, 0, 1, 2, 1, 1, 4, 5)
POSITIONS = np.array(
    [[0, 1, 0], [0, 1.2, 0], [0, 1.5, 0], [0, 1.6, 0], [0.2, 1.4, 0], [-0.2, 1.4, 0], [0.45, 1.4, 0], [-0.45, 1.4, 0]]
)
HEAD = 3
CENTRE = np.array([0.0, 1.68, 0.02])
RADIUS = 0.1
HAIR, RIG, MOTION, SKIN = "/Hero/Hair", "/Hero/Rig", "/Hero/Rig/Motion", "/Hero/Skin"


@dataclass(frozen=True)
class Recipe:
    """How a shot is written; lengths stay the same in metres whatever is chosen.

    Attributes:
        unit: metres per unit.
        up: "Y" or "Z".
        rate: time codes per second.
        frames: number of frames of animation from frame 1; 0 writes no animation.
        strands, vertices: of the groom.
        bound: "own" (skel binding on the groom), "mesh" (it sits on the skin) or "none" (no mesh at all).
        nesting: prefix of all prims.
        place: stage-space transform of the character's root, column vectors, metres, Y up; None for none.
        skel_root: whether the character lies below a SkelRoot.
        basis: "linear" or a cubic basis.
        extension: of the file.
    """

    unit: float = 1.0
    up: str = "Y"
    rate: float = 24.0
    frames: int = 9
    strands: int = 40
    vertices: int = 12
    bound: str = "own"
    nesting: str = "/Hero"
    place: np.ndarray | None = None
    skel_root: bool = True
    basis: str = "linear"
    extension: str = "usda"


def write_shot(folder: Path, recipe: Recipe = Recipe(), name: str = "shot") -> Path:
    """Write the shot; returns its path. Of each recipe, USD writes one file, and the others are copies."""
    path = Path(folder) / f"{name}.{recipe.extension}"
    made = replace(recipe, place=None), None if recipe.place is None else recipe.place.tobytes()
    if made in _WRITTEN:
        path.parent.mkdir(parents=True, exist_ok=True)  # as USD does
        path.write_bytes(_WRITTEN[made])
    else:
        _write(path, recipe)
        _WRITTEN[made] = path.read_bytes()
    return path


_WRITTEN: dict[tuple, bytes] = {}


def _write(path: Path, recipe: Recipe) -> None:
    stage = Usd.Stage.CreateNew(str(path))
    to_stage = np.eye(4)
    if recipe.up == "Z":
        to_stage[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    to_stage[:3, :3] /= recipe.unit
    UsdGeom.SetStageMetersPerUnit(stage, recipe.unit)
    UsdGeom.SetStageUpAxis(stage, recipe.up)
    stage.SetTimeCodesPerSecond(recipe.rate)
    stage.SetFramesPerSecond(recipe.rate)
    if recipe.frames:
        stage.SetStartTimeCode(1)
        stage.SetEndTimeCode(recipe.frames)
    root = recipe.nesting
    for above in Sdf.Path(root).GetPrefixes()[:-1]:
        UsdGeom.Xform.Define(stage, above)
    kind = UsdSkel.Root if recipe.skel_root else UsdGeom.Xform
    top = kind.Define(stage, root)
    stage.SetDefaultPrim(stage.GetPrimAtPath(Sdf.Path(root).GetPrefixes()[0]))
    if recipe.place is not None:
        top.AddTransformOp().Set(Gf.Matrix4d((to_stage @ recipe.place @ np.linalg.inv(to_stage)).T.tolist()))
    skeleton = _skeleton(stage, root, to_stage, recipe)
    if recipe.bound != "none":
        _skin(stage, root, to_stage, skeleton)
    _groom(stage, root, to_stage, skeleton, recipe)
    stage.GetRootLayer().Save()


def edited(folder: Path, edit, recipe: Recipe = Recipe()) -> Path:
    """A shot whose stage a function has changed."""
    path = write_shot(folder, recipe)
    stage = Usd.Stage.Open(str(path))
    edit(stage)
    stage.GetRootLayer().Save()
    return path


def place_skeleton(stage: Usd.Stage, place: np.ndarray) -> None:
    """Put the skeleton's prim elsewhere, (4, 4) of one scale, and its joints back to where they were: bind transforms, which stay, are
    then in the world's space and not in the skeleton's.
    """
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(RIG))
    motion = UsdSkel.Animation(stage.GetPrimAtPath(MOTION))
    skeleton.AddTransformOp().Set(Gf.Matrix4d(place.T.tolist()))
    back = np.linalg.inv(place).T
    rest = np.array(skeleton.GetRestTransformsAttr().Get())
    skeleton.GetRestTransformsAttr().Set(Vt.Matrix4dArray.FromNumpy(np.concatenate([rest[:1] @ back, rest[1:]])))
    channels = motion.GetTranslationsAttr(), motion.GetRotationsAttr(), motion.GetScalesAttr()
    poses = {}
    for code in motion.GetTranslationsAttr().GetTimeSamples():
        poses[code] = np.array(UsdSkel.MakeTransforms(*(channel.Get(code) for channel in channels)))
        poses[code][:1] = poses[code][:1] @ back
    for channel in channels:
        channel.Clear()
    for code, pose in poses.items():
        for channel, values in zip(
            channels, UsdSkel.DecomposeTransforms(Vt.Matrix4dArray.FromNumpy(pose)), strict=True
        ):
            channel.Set(values, code)


def write_loop(folder: Path) -> Path:
    """Write a shot of six strands on a head that shakes once in 12 frames, with the 13th frame like the first."""
    path = write_shot(folder, Recipe(frames=13, strands=6), "loop")
    stage = Usd.Stage.Open(str(path))
    animation = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
    still = animation.GetTranslationsAttr().Get(1.0)
    for frame in range(1, 14):
        turns = [Gf.Quatf(1)] * len(JOINTS)
        angle = 45 * np.sin(np.pi * (frame - 1) / 6)
        turns[HEAD] = Gf.Quatf(Gf.Rotation(Gf.Vec3d(0.5, 1, 0), float(angle)).GetQuat())
        animation.GetRotationsAttr().Set(Vt.QuatfArray(turns), frame)
        animation.GetTranslationsAttr().Set(still, frame)
    stage.Save()
    return path


def strand_points(strands: int, vertices: int) -> np.ndarray:
    """(strands, vertices, 3) [m]: slightly curled hair on the upper half of the head."""
    rng = np.random.default_rng(5)
    out = rng.normal(size=(strands, 3))
    out[:, 1] = np.abs(out[:, 1])
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    s = np.linspace(0, 1, vertices)[None, :, None]
    points = CENTRE + out[:, None] * (RADIUS + 0.08 * s) + np.array([0, -0.2, 0]) * s**2
    return points + 0.004 * np.sin(9 * s + rng.uniform(0, 6, (strands, 1, 3))) * s


def add_curves(stage, path: str, points: np.ndarray) -> None:
    """Straight curves (n, 2, 3) [m], of two points each, without a binding."""
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreateTypeAttr("linear")
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    curves.CreateCurveVertexCountsAttr([2] * len(points))


def _matrix(to_stage: np.ndarray, position: np.ndarray) -> np.ndarray:
    """A joint's stage-space transform: a plain rotation to stage axes, and its place."""
    matrix = np.eye(4)
    matrix[:3, :3] = to_stage[:3, :3] / np.cbrt(np.linalg.det(to_stage[:3, :3]))
    matrix[:3, 3] = to_stage[:3, :3] @ position
    return matrix


def _skeleton(stage, root, to_stage, recipe: Recipe):
    skeleton = UsdSkel.Skeleton.Define(stage, f"{root}/Rig")
    bind = np.stack([_matrix(to_stage, p) for p in POSITIONS])
    local = np.stack([np.linalg.inv(bind[p]) @ b if p >= 0 else b for p, b in zip(PARENTS, bind)])
    skeleton.CreateJointsAttr(JOINTS)
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(m.T.tolist()) for m in bind])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(m.T.tolist()) for m in local])
    if recipe.frames:
        animation = UsdSkel.Animation.Define(stage, f"{root}/Rig/Motion")
        animation.CreateJointsAttr(JOINTS)
        animation.CreateScalesAttr(Vt.Vec3hArray([Gf.Vec3h(1)] * len(JOINTS)))
        for frame in range(1, recipe.frames + 1):
            _pose(animation, local, (frame - 1) / recipe.rate, frame, to_stage)
        UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    return skeleton


def _pose(animation, local, seconds, frame, to_stage) -> None:
    """The head shakes, the arms swing, the hips bob; at rest at time 0."""
    angles = np.zeros((len(JOINTS), 3))
    angles[HEAD] = 0.3 * np.sin(6 * seconds), 0.8 * np.sin(9 * seconds), 0.1 * np.sin(4 * seconds)
    angles[4, 2], angles[5, 2] = -0.5 * seconds, 0.5 * seconds
    rotations, translations = [], []
    for joint, matrix in enumerate(local):
        turn = Gf.Rotation()
        turn.SetIdentity()
        for axis in range(3):
            turn = turn * Gf.Rotation(Gf.Vec3d(*np.eye(3)[axis]), float(np.degrees(angles[joint, axis])))
        rest = Gf.Matrix4d(matrix.T.tolist()).ExtractRotation()
        rotations.append(Gf.Quatf((turn * rest).GetQuat()))
        offset = to_stage[:3, :3] @ [0.02 * np.sin(3 * seconds), 0.05 * seconds, 0] if joint == 0 else np.zeros(3)
        translations.append(Gf.Vec3f(*(matrix[:3, 3] + offset)))
    animation.CreateRotationsAttr().Set(Vt.QuatfArray(rotations), frame)
    animation.CreateTranslationsAttr().Set(Vt.Vec3fArray(translations), frame)


def _skin(stage, root, to_stage, skeleton) -> None:
    """A ball for the head and a smaller one for the chest."""
    rings = np.linspace(0.02, np.pi - 0.02, 13)
    around = np.linspace(0, 2 * np.pi, 17)[:-1]
    ball = np.stack(
        [
            np.outer(np.sin(rings), np.sin(around)),
            np.outer(np.cos(rings), np.ones(16)),
            np.outer(np.sin(rings), np.cos(around)),
        ],
        -1,
    ).reshape(-1, 3)
    cells = [(r * 16 + c, (r + 1) * 16 + c, (r + 1) * 16 + (c + 1) % 16, r * 16 + (c + 1) % 16)
             for r in range(12) for c in range(16)]  # fmt: skip
    points = np.concatenate([CENTRE + RADIUS * ball, [0, 1.3, 0] + 0.15 * ball])
    faces = np.concatenate([np.array(cells), np.array(cells) + len(ball)])
    mesh = UsdGeom.Mesh.Define(stage, f"{root}/Skin")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy((points @ to_stage[:3, :3].T).astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([4] * len(faces))
    mesh.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    joints = np.repeat([HEAD, 1], len(ball))
    binding.CreateJointIndicesPrimvar(False, 1).Set(Vt.IntArray(joints.tolist()))
    binding.CreateJointWeightsPrimvar(False, 1).Set(Vt.FloatArray([1.0] * len(joints)))
    binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))


def _groom(stage, root, to_stage, skeleton, recipe: Recipe) -> None:
    curves = UsdGeom.BasisCurves.Define(stage, f"{root}/Hair")
    points = strand_points(recipe.strands, recipe.vertices).reshape(-1, 3) @ to_stage[:3, :3].T
    cubic = recipe.basis != "linear"
    curves.CreateTypeAttr("cubic" if cubic else "linear")
    if cubic:
        curves.CreateBasisAttr(recipe.basis)
        curves.CreateWrapAttr("pinned")
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    curves.CreateCurveVertexCountsAttr([recipe.vertices] * recipe.strands)
    curves.CreateWidthsAttr([1e-4 / recipe.unit])
    curves.SetWidthsInterpolation("constant")
    curves.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(curves.GetPointsAttr().Get()))
    if recipe.bound == "own":
        binding = UsdSkel.BindingAPI.Apply(curves.GetPrim())
        binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
        binding.CreateJointIndicesPrimvar(True, 1).Set(Vt.IntArray([HEAD]))
        binding.CreateJointWeightsPrimvar(True, 1).Set(Vt.FloatArray([1.0]))
        binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))


def world_points(path, code, prim="/Hero/Hair"):
    """(P, 3) points of a groom in world space, metres, Y up, as a renderer places them."""
    stage = open_stage(path)
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath(prim))
    matrix = np.array(UsdGeom.XformCache(code).GetLocalToWorldTransform(curves.GetPrim())).T
    points = np.asarray(curves.GetPointsAttr().Get(code), float) @ matrix[:3, :3].T + matrix[:3, 3]
    if UsdGeom.GetStageUpAxis(stage) == "Z":
        points = points @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]).T
    return points * UsdGeom.GetStageMetersPerUnit(stage)


def samples(path, *names, at=None, prim="/Hero/Hair"):
    """Values of the groom's attributes at a time code (default time for None)."""
    stage = open_stage(path)
    code = Usd.TimeCode.Default() if at is None else Usd.TimeCode(at)
    values = [np.asarray(stage.GetPrimAtPath(prim).GetAttribute(name).Get(code)) for name in names]
    return values if len(values) > 1 else values[0]
