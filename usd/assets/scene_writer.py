# SPDX-License-Identifier: Apache-2.0
"""Write an animated character with hair as a shot, from arrays, for applications without a USD exporter of their own."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.files import as_path

from ..border.arrays import floats, integers, quaternions, row_matrix, vectors
from ..border.stage_files import write_stage
from ..shot.bakes.bake_record import KEY
from .prims import Spline, author_curves, author_influences, author_skeleton, bind_rigidly, bind_to

ROOT = "/Character"
RIG = f"{ROOT}/Rig"
PLAYER = f"{KEY}Player"
"""Key of the root's customData that names the file which plays the bake."""


@dataclass(frozen=True, eq=False)
class SkinArrays:
    """A skinned mesh in bind world space.

    Attributes:
        name: a valid identifier.
        points: (V, 3); triangles: (F, 3).
        joint_indices, joint_weights: (V, I).
        shapes: blend shape name (a valid identifier) -> offsets (V, 3).
    """

    name: str
    points: np.ndarray
    triangles: np.ndarray
    joint_indices: np.ndarray
    joint_weights: np.ndarray
    shapes: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class HairArrays:
    """A groom.

    Attributes:
        name: a valid identifier.
        points: (P, 3) in the prim's own space; counts: (S,); widths: (P,), (S,), or (1,) for all.
        bind_place: the prim's place in the bind pose, (4, 4).
        places: its place at every frame, (T, 4, 4).
        joint: index of the joint that carries it.
        spline: how its vertices are interpolated.
        visible: whether it is drawn.
        keeps_widths: whether its application keeps its own widths when it plays the bake; see `author_curves`.
    """

    name: str
    points: np.ndarray
    counts: np.ndarray
    widths: np.ndarray
    bind_place: np.ndarray
    places: np.ndarray
    joint: int
    spline: Spline = Spline()
    visible: bool = True
    keeps_widths: bool = False


@dataclass(frozen=True, eq=False)
class SceneArrays:
    """A character in motion, in the units of the stage, Z up.

    Attributes:
        metres_per_unit, rate: of the stage.
        frames: time codes, (T,).
        joints: joint paths, parents first, (J); bind: their bind transforms in the world, (J, 4, 4).
        rest: local rest transforms, (J, 4, 4).
        translation, rotation, scale: (T, J, 3), (T, J, 4) wxyz, (T, J, 3), local.
        skins: skinned meshes; shape: weights (T, B) of their blend shapes, mesh after mesh.
        hair: grooms.
        name: what its application calls the character.
        player: the application's file that plays the bake over this shot, relative to the shot; empty if none does.
    """

    metres_per_unit: float
    rate: float
    frames: np.ndarray
    joints: list[str]
    bind: np.ndarray
    rest: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    scale: np.ndarray
    skins: list[SkinArrays]
    shape: np.ndarray
    hair: list[HairArrays]
    name: str = ""
    player: str = ""


def write_scene(path, scene: SceneArrays) -> Path:
    """Write the shot, whole or not at all.

    Raises:
        NeuralocksError: the file cannot be written there.
    """
    return write_stage(as_path(path, "path"), lambda stage: _author(stage, scene))


def prim_path(name: str) -> str:
    """Prim path of the groom or mesh with this name."""
    return f"{ROOT}/{name}"


def _author(stage: Usd.Stage, scene: SceneArrays) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, scene.metres_per_unit)
    stage.SetTimeCodesPerSecond(scene.rate)
    stage.SetFramesPerSecond(scene.rate)
    stage.SetStartTimeCode(float(scene.frames[0]))
    stage.SetEndTimeCode(float(scene.frames[-1]))
    root = UsdSkel.Root.Define(stage, ROOT)
    root.GetPrim().SetCustomDataByKey(KEY, "shot")  # `own_layers` recognises it by this
    if scene.player:
        root.GetPrim().SetCustomDataByKey(PLAYER, scene.player)
    if scene.name:
        root.GetPrim().SetDisplayName(scene.name)
    stage.SetDefaultPrim(root.GetPrim())
    skeleton = author_skeleton(stage, RIG, scene.joints, scene.bind, scene.rest)
    animation = _animation(stage, scene)
    UsdSkel.BindingAPI(skeleton).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
    for skin in scene.skins:
        _skin(stage, skin, skeleton)
    for hair in scene.hair:
        _hair(stage, hair, scene.frames, skeleton)


def _animation(stage: Usd.Stage, scene: SceneArrays) -> UsdSkel.Animation:
    animation = UsdSkel.Animation.Define(stage, f"{RIG}/Motion")
    animation.CreateJointsAttr(scene.joints)
    translations, rotations, scales = (
        animation.CreateTranslationsAttr(),
        animation.CreateRotationsAttr(),
        animation.CreateScalesAttr(),
    )
    shapes = [name for skin in scene.skins for name in skin.shapes]
    if shapes:
        animation.CreateBlendShapesAttr(shapes)
        weights = animation.CreateBlendShapeWeightsAttr()
    for row, frame in enumerate(map(float, scene.frames)):
        translations.Set(vectors(scene.translation[row]), frame)
        rotations.Set(quaternions(scene.rotation[row]), frame)
        scales.Set(Vt.Vec3hArray.FromNumpy(np.ascontiguousarray(scene.scale[row], np.float16)), frame)
        if shapes:
            weights.Set(floats(scene.shape[row]), frame)
    return animation


def _skin(stage: Usd.Stage, skin: SkinArrays, skeleton: UsdSkel.Skeleton) -> None:
    mesh = UsdGeom.Mesh.Define(stage, prim_path(skin.name))
    mesh.CreatePointsAttr(vectors(skin.points))
    mesh.CreateExtentAttr(vectors([skin.points.min(axis=0), skin.points.max(axis=0)]))
    mesh.CreateFaceVertexCountsAttr(integers(np.full(len(skin.triangles), 3)))
    mesh.CreateFaceVertexIndicesAttr(integers(skin.triangles))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    binding = bind_to(skeleton, mesh.GetPrim(), np.eye(4))
    author_influences(binding, skin.joint_indices, skin.joint_weights)
    targets = []
    for name, offsets in skin.shapes.items():
        shape = UsdSkel.BlendShape.Define(stage, mesh.GetPath().AppendChild(f"shape_{name}"))
        shape.CreateOffsetsAttr(vectors(offsets))
        shape.CreateNormalOffsetsAttr(vectors(np.zeros_like(offsets)))
        targets.append(shape.GetPath())
    if targets:
        binding.CreateBlendShapesAttr(list(skin.shapes))
        binding.CreateBlendShapeTargetsRel().SetTargets(targets)


def _hair(stage: Usd.Stage, hair: HairArrays, frames: np.ndarray, skeleton: UsdSkel.Skeleton) -> None:
    curves = author_curves(
        stage, prim_path(hair.name), hair.points, hair.counts, hair.widths, hair.spline, hair.keeps_widths
    )
    op = curves.AddTransformOp(UsdGeom.XformOp.PrecisionDouble)
    op.Set(row_matrix(hair.places[0]))
    if (np.abs(hair.places - hair.places[0]) > 1e-9).any():
        for frame, place in zip(map(float, frames), hair.places, strict=True):
            op.Set(row_matrix(place), frame)
    bind_rigidly(skeleton, curves.GetPrim(), hair.bind_place, hair.joint)
    if not hair.visible:
        curves.MakeInvisible()
