# SPDX-License-Identifier: Apache-2.0
"""Write a character as a UsdSkel asset: skeleton, skinned mesh, blend shapes, scalp."""

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from neuralocks_core.body.statistical_body import StatisticalBody, statistical_body
from neuralocks_core.files import as_path, check_writable
from neuralocks_core.rotation import relative_to_parents

from ..border.arrays import integers, vectors
from ..border.stage_files import check_layer_name, write_stage
from .prims import author_influences, author_skeleton, bind_to

ROOT = "/Body"
SKELETON = f"{ROOT}/Rig"
MESH = f"{ROOT}/Skin"


def write_body(path, body: StatisticalBody | None = None, *, phenotype: dict[str, float] | None = None) -> Path:
    """Write the statistical body as a USD character: metres, Y up, facing +Z, at rest.

    Args:
        path: file to write (.usd, .usda, .usdc); replaced once everything is written.
        body: what to write; the default builds anny, which takes about a minute the first time.
        phenotype: anny's parameters, 0..1, for the default body.

    Raises:
        NeuralocksError: the path has another extension or cannot be written, anny is missing or a phenotype is wrong.
    """
    path = as_path(path, "path")
    check_layer_name(path)
    check_writable(path)
    body = statistical_body(phenotype) if body is None else body
    return write_stage(path, lambda stage: _author(stage, body))


def _author(stage, body: StatisticalBody) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdSkel.Root.Define(stage, ROOT)
    stage.SetDefaultPrim(root.GetPrim())
    Usd.ModelAPI(root).SetKind("component")
    joints = body.character.skeleton
    rest = relative_to_parents(joints.bind, joints.parents)
    skeleton = author_skeleton(stage, SKELETON, joints.names, joints.bind, rest)
    mesh = _mesh(stage, body)
    binding, skin = bind_to(skeleton, mesh.GetPrim(), np.eye(4)), body.character.body
    author_influences(binding, skin.joint_indices, skin.joint_weights)
    _blend_shapes(stage, binding, skin.shapes)
    # A skinned mesh moves beyond its own points, so usdview and the validators read the root's extent.
    UsdGeom.Boundable(root).CreateExtentAttr(vectors([skin.points.min(axis=0), skin.points.max(axis=0)]))


def _mesh(stage, body):
    mesh = UsdGeom.Mesh.Define(stage, MESH)
    mesh.CreatePointsAttr(vectors(body.character.body.points))
    mesh.CreateFaceVertexCountsAttr(integers(np.full(len(body.faces), body.faces.shape[1])))
    mesh.CreateFaceVertexIndicesAttr(integers(body.faces))
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(mesh.GetPointsAttr().Get()))
    # Normals would have to be skinned too; a subdivision surface is shaded smoothly without any.
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
    mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(vectors(body.colors))
    UsdGeom.Subset.CreateGeomSubset(mesh, "scalp", UsdGeom.Tokens.face, integers(body.scalp), "hair")
    return mesh


def _blend_shapes(stage, binding, shapes) -> None:
    names, paths = [], []
    for name, offsets in shapes.items():
        # Only points that move by a hundredth of a millimetre are stored.
        moved = np.flatnonzero(np.abs(offsets).max(axis=1) > 1e-5)
        if not len(moved):  # the body's own phenotype is this shape already
            continue
        shape = UsdSkel.BlendShape.Define(stage, f"{MESH}/{name}")
        shape.CreateOffsetsAttr(vectors(offsets[moved]))
        shape.CreatePointIndicesAttr(integers(moved))
        names.append(name)
        paths.append(Sdf.Path(str(shape.GetPath())))
    binding.CreateBlendShapesAttr(names)
    binding.CreateBlendShapeTargetsRel().SetTargets(paths)
