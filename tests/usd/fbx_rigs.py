# SPDX-License-Identifier: Apache-2.0
"""Characters as they come from FBX files: centimetres, Z up, any joint orient, hair that is animated by hand."""

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt
from scipy.spatial.transform import Rotation

CHAIN, SINGLE = (-1, 0, 1, 2, 3), (-1, 0)
FORK = (-1, 0, 1, 2, 1, 4, 5)
"""Parents within a chain; its last joints are ends that drive nothing."""
LAYOUTS = {24: [CHAIN, CHAIN, FORK, CHAIN, SINGLE], 62: [CHAIN] * 8 + [FORK] * 2 + [SINGLE] * 4}
TO_STAGE = 100 * np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
FRAMES = 20


def write_character(path, joints: int, prefix: str = "rig_"):
    """A shot of a nodding, turning head with `joints` hair joints, ends included.

    Returns:
        how many of them move, in how many chains.
    """
    rng = np.random.default_rng(joints)
    names, parents, places = ["Hips"], [-1], [(0, 0.95, 0)]
    for name, place in (("Spine", (0, 1.2, 0)), ("Neck", (0, 1.45, 0)), ("Head", (0, 1.55, 0.01))):
        parents.append(len(names) - 1)
        names.append(name)
        places.append(place)
    body = len(names)
    moving = 0
    for number, layout in enumerate(LAYOUTS[joints]):
        first = len(names)
        angle = 2 * np.pi * (number + 0.5) / len(LAYOUTS[joints])
        out = np.array([np.sin(angle), 0, np.cos(angle)])
        for i, up in enumerate(layout):
            names.append(f"hair{number:02d}_{i}")
            parents.append(body - 1 if up < 0 else first + up)
            if up < 0:
                places.append(np.array([0, 1.68, 0]) + 0.11 * out)
            else:  # the second arm of a fork turns aside
                aside = 0.03 * np.cross(out, [0, 1, 0]) if i - up > 1 else 0
                places.append(places[first + up] + np.array([0, -0.06, 0]) + 0.01 * out + aside)
        moving += len(set(layout) - {-1})
    paths = []
    for name, parent in zip(names, parents):
        paths.append(f"{paths[parent]}/{prefix}{name}" if parent >= 0 else prefix + name)
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    bind[:, :3, :3] = Rotation.random(len(names), random_state=joints).as_matrix()
    bind[:, :3, 3] = np.array(places, float) @ TO_STAGE.T
    local = np.array([np.linalg.inv(bind[p]) @ m if p >= 0 else m for p, m in zip(parents, bind)])
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.SetStageUpAxis(stage, "Z")
    stage.SetTimeCodesPerSecond(30)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(FRAMES)
    root = UsdSkel.Root.Define(stage, "/Fbx")
    stage.SetDefaultPrim(root.GetPrim())
    skeleton = UsdSkel.Skeleton.Define(stage, "/Fbx/Armature")
    skeleton.CreateJointsAttr(paths)
    skeleton.CreateBindTransformsAttr(_matrices(bind))
    skeleton.CreateRestTransformsAttr(_matrices(local))
    _animate(stage, skeleton, paths, local, body, rng)
    ends = set(range(body, len(names))) - set(parents)
    _hair(stage, skeleton, [j for j in range(body, len(names)) if j not in ends], parents, bind[:, :3, 3])
    _body(stage, skeleton, bind[:, :3, 3])
    stage.GetRootLayer().Save()
    return moving, len(LAYOUTS[joints])


def _animate(stage, skeleton, paths, local, body, rng):
    """The first frame is the bind pose; hair joints wave, and one is stretched, by hand."""
    animation = UsdSkel.Animation.Define(stage, "/Fbx/Armature/Take")
    animation.CreateJointsAttr(paths)
    phase = rng.uniform(0, 6, len(paths))
    own = Rotation.from_matrix(local[:, :3, :3])
    for frame in range(FRAMES):
        wave = np.sin(np.pi * frame / (FRAMES - 1) * 2)
        vectors = np.zeros((len(paths), 3))
        vectors[1] = 0.05 * wave
        vectors[2:body] = (0.4 * wave, 0.3 * wave, 0.1)
        vectors[body:, 0] = 0.3 * np.sin(phase + frame)[body:]
        if frame == 0:
            vectors[:] = 0
        turns = np.roll((own * Rotation.from_rotvec(vectors)).as_quat(), 1, axis=1)
        animation.CreateRotationsAttr().Set(Vt.QuatfArray([Gf.Quatf(*map(float, q)) for q in turns]), frame + 1)
        places = local[:, :3, 3].copy()
        places[0, 0] += 3 * wave
        places[body + 1] *= 1 + 0.1 * wave
        animation.CreateTranslationsAttr().Set(Vt.Vec3fArray.FromNumpy(places.astype(np.float32)), frame + 1)
    animation.CreateScalesAttr([Gf.Vec3h(1)] * len(paths))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])


def _hair(stage, skeleton, moving, parents, places):
    points, joints = [], []
    for joint in moving:
        for child in np.flatnonzero(np.array(parents) == joint):
            for share in (0.2, 0.8):
                at = (1 - share) * places[joint] + share * places[child]
                points += [at + (0.8, 0, 0), at - (0.8, 0, 0), at + (0, 0.8, 0)]
                joints += [joint] * 3
    _mesh(stage, skeleton, "Hair", np.array(points), np.arange(len(points)).reshape(-1, 3), joints)


def _body(stage, skeleton, places):
    """A ball for the head, a larger one for the shoulders."""
    around, across = np.meshgrid(np.arange(16) * np.pi / 8, np.linspace(0.15, np.pi - 0.15, 9), indexing="ij")
    ball = np.stack([np.sin(across) * np.cos(around), np.sin(across) * np.sin(around), np.cos(across)], -1)
    faces = []
    for i in range(16):
        for j in range(8):
            a, b = 9 * i + j, 9 * ((i + 1) % 16) + j
            faces += [(a, a + 1, b), (b, a + 1, b + 1)]
    ball, faces = ball.reshape(-1, 3), np.array(faces)
    points = np.concatenate([ball * 9 + places[3] + (0, 0, 9), ball * (20, 10, 14) + places[1]])
    joints = [3] * len(ball) + [1] * len(ball)
    _mesh(stage, skeleton, "Body", points, np.concatenate([faces, faces + len(ball)]), joints)


def _mesh(stage, skeleton, name, points, faces, joints):
    mesh = UsdGeom.Mesh.Define(stage, f"/Fbx/{name}")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr([3] * len(faces))
    mesh.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
    binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateJointIndicesPrimvar(False, 1).Set([int(j) for j in joints])
    binding.CreateJointWeightsPrimvar(False, 1).Set([1.0] * len(joints))


def _matrices(matrices):
    return Vt.Matrix4dArray([Gf.Matrix4d(*np.asarray(m).T.ravel().tolist()) for m in matrices])
