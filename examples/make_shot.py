# SPDX-License-Identifier: Apache-2.0
"""Build the shipped shot: python examples/make_shot.py [-o examples/shot] [--strands 3200] [--body]

Layers as in a pipeline: body.usdc (character), motion.usdc (animation), groom.usdc (hair at rest, skinned to the
head) and shot.usda, which puts them together with a camera and lights.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdSkel, Vt

sys.path[:0] = [str(Path(__file__).resolve().parent), str(Path(__file__).resolve().parents[1])]

from acting import SECONDS, act

from neuralocks_core.groom import Groom
from neuralocks_core.hairstyles import grow
from neuralocks_core.hairstyles.scalp import Scalp
from neuralocks_core.strands.arclength import resample
from usd.assets.animation import write_animation
from usd.assets.body import MESH, ROOT, SKELETON, write_body
from usd.assets.prims import POLYLINES, author_curves, bind_rigidly
from usd.shot.stage import StageRig, read_rigs

RATE = 24.0
VERTICES = 24
HAIR = f"{ROOT}/Hair"
HAIR_COLOR = (0.105, 0.042, 0.018)


def main() -> None:
    """Write the four layers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parent / "shot")
    parser.add_argument("--strands", type=int, default=3200)
    parser.add_argument("--style", default="wavy")
    parser.add_argument("--body", action="store_true", help="build the body again (needs anny)")
    options = parser.parse_args()
    folder = options.output
    folder.mkdir(parents=True, exist_ok=True)
    body = folder / "body.usdc"
    if options.body or not body.exists():
        write_body(body)
    rig = read_rigs(body)[0]
    write_motion(folder / "motion.usdc", rig.character)
    write_groom(folder / "groom.usdc", grow_groom(body, options.style, options.strands), rig)
    write_shot(folder / "shot.usda")
    for name in ("body.usdc", "motion.usdc", "groom.usdc", "shot.usda"):
        print(f"{folder / name}: {(folder / name).stat().st_size / 1e6:.2f} MB")


def grow_groom(body: Path, style: str, strands: int) -> Groom:
    """Hair in one of the library's styles on the body's marked scalp."""
    character = read_rigs(body)[0].character
    stage = Usd.Stage.Open(str(body))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(MESH))
    marked = UsdGeom.Subset(stage.GetPrimAtPath(f"{MESH}/scalp")).GetIndicesAttr().Get()
    quads = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 4)[np.array(marked)]
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    to_bind = character.canonical_to_bind
    centre = to_bind[:3, :3] @ character.head_centre + to_bind[:3, 3]
    skin = character.body
    scalp = Scalp(np.array(mesh.GetPointsAttr().Get(), float), triangles, centre)
    groom = grow(style, scalp, strands, seed=1, body=(skin.points, skin.triangles))
    # With the network's number of vertices, a bake of ten seconds stays under half a gigabyte.
    points, _ = resample(groom, VERTICES)
    kept = np.linspace(0, groom.counts[0] - 1, VERTICES, dtype=int)
    width = np.reshape(groom.widths, (strands, -1))[:, kept]
    return replace(
        groom,
        points=points.reshape(-1, 3).astype(np.float32),
        counts=np.full(strands, VERTICES, np.int32),
        widths=width.ravel(),
    )


def write_motion(path: Path, character) -> None:
    """The animation, and its binding to the skeleton."""
    stage = _layer(path)
    clip = act(character, RATE)
    write_animation(stage, f"{ROOT}/Motion", character, clip)
    rig = stage.OverridePrim(SKELETON)
    UsdSkel.BindingAPI.Apply(rig).CreateAnimationSourceRel().SetTargets([Sdf.Path(f"{ROOT}/Motion")])
    # A skinned character leaves its rest box as it walks: its extent follows the hips.
    extent = stage.OverridePrim(ROOT).CreateAttribute("extent", Sdf.ValueTypeNames.Float3Array, False)
    rest = character.body.points
    for k, hips in enumerate(clip.joints[:, character.humanoid["hips"], :3, 3]):
        low, high = rest.min(axis=0) - [0, 0, 0.5], rest.max(axis=0) + [0, 0.1, 0.5]
        shift = hips - character.skeleton.bind[character.humanoid["hips"], :3, 3]
        extent.Set([Gf.Vec3f(*map(float, low + shift)), Gf.Vec3f(*map(float, high + shift))], 1.0 + k)
    stage.Save()


def write_groom(path: Path, groom: Groom, rig: StageRig) -> None:
    """The hair at rest as linear curves, skinned rigidly to the head."""
    stage = _layer(path)
    curves = author_curves(stage, HAIR, groom.points, groom.counts, groom.widths, POLYLINES)
    curves.CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set([Gf.Vec3f(*HAIR_COLOR)])
    primvars = UsdGeom.PrimvarsAPI(curves)
    if groom.root_uv is not None:
        uv = primvars.CreatePrimvar("groom_root_uv", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.uniform)
        uv.Set(Vt.Vec2fArray.FromNumpy(np.float32(groom.root_uv)))
    binding = bind_rigidly(UsdSkel.Skeleton(rig.joints.prim), curves.GetPrim(), np.eye(4), 0)
    binding.CreateJointsAttr([rig.joints.names[rig.character.head]])
    stage.Save()


def write_shot(path: Path) -> None:
    """The layers together, with a camera and lights."""
    stage = _layer(path)
    layer = stage.GetRootLayer()
    layer.subLayerPaths = ["./motion.usdc", "./groom.usdc", "./body.usdc"]
    camera = UsdGeom.Camera.Define(stage, "/Camera")
    camera.AddTransformOp().Set(_looking(Gf.Vec3d(0.75, 1.5, 4.4), Gf.Vec3d(-0.15, 1.2, 0)))
    camera.CreateFocalLengthAttr(50.0)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.1, 100))
    key = UsdLux.DistantLight.Define(stage, "/Key")
    key.CreateIntensityAttr(2500.0)
    key.CreateAngleAttr(4.0)
    key.AddRotateXYZOp().Set(Gf.Vec3f(-40, 35, 0))
    UsdLux.DomeLight.Define(stage, "/Fill").CreateIntensityAttr(0.6)
    stage.Save()


def _layer(path: Path) -> Usd.Stage:
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(RATE)
    stage.SetFramesPerSecond(RATE)
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(1 + round(SECONDS * RATE))
    stage.SetDefaultPrim(stage.OverridePrim(ROOT))
    return stage


def _looking(eye: Gf.Vec3d, at: Gf.Vec3d) -> Gf.Matrix4d:
    return Gf.Matrix4d().SetLookAt(eye, at, Gf.Vec3d(0, 1, 0)).GetInverse()


if __name__ == "__main__":
    main()
