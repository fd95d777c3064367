# SPDX-License-Identifier: Apache-2.0
"""Curves, skeletons and skin bindings as prims of a new stage, from arrays."""

from dataclasses import dataclass

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from ..border.arrays import floats, integers, row_matrices, row_matrix, vectors


@dataclass(frozen=True)
class Spline:
    """How a renderer interpolates the vertices: the tokens of UsdGeomBasisCurves."""

    type: str = "linear"
    basis: str = "bezier"
    wrap: str = "nonperiodic"


POLYLINES = Spline()
"""Straight from vertex to vertex."""


def author_curves(
    stage: Usd.Stage, path, points, counts, widths, spline: Spline, as_primvar: bool = False
) -> UsdGeom.BasisCurves:
    """Define a BasisCurves prim.

    Args:
        stage: where.
        path: of the prim.
        points: (P, 3) in the prim's own space.
        counts: (S,) vertices of each curve.
        widths: (P,), (S,), or (1,) for all.
        spline: how the vertices are interpolated.
        as_primvar: write the widths as the primvar that renderers take before the curves' own. Blender does not, so hair that
            plays the prim keeps its own.
    """
    curves = UsdGeom.BasisCurves.Define(stage, path)
    points, widths = np.asarray(points, np.float32), np.asarray(widths, np.float32)
    curves.CreateTypeAttr(spline.type)
    if spline.type == "cubic":
        curves.CreateBasisAttr(spline.basis)
    curves.CreateWrapAttr(spline.wrap)
    curves.CreatePointsAttr(vectors(points))
    curves.CreateCurveVertexCountsAttr(integers(counts))
    if len(widths) == len(counts) > 1:
        # Blender reads one width for all, or one a vertex, beyond their end if there are fewer.
        widths = np.repeat(widths, counts)
    kind = UsdGeom.Tokens.constant if len(widths) == 1 else UsdGeom.Tokens.vertex
    if as_primvar:
        UsdGeom.PrimvarsAPI(curves).CreatePrimvar("widths", Sdf.ValueTypeNames.FloatArray, kind).Set(floats(widths))
    else:
        curves.CreateWidthsAttr(floats(widths))
        curves.SetWidthsInterpolation(kind)
    reach = np.float32(widths.max() / 2)
    curves.CreateExtentAttr(vectors([points.min(axis=0) - reach, points.max(axis=0) + reach]))
    return curves


def author_skeleton(stage: Usd.Stage, path: str, joints, bind: np.ndarray, rest: np.ndarray) -> UsdSkel.Skeleton:
    """Define a Skeleton that an animation can be bound to.

    Args:
        stage: where.
        path: of the prim.
        joints: their paths, parents first, (J).
        bind: bind transforms in the world, (J, 4, 4).
        rest: rest transforms relative to the parent joint, (J, 4, 4).
    """
    skeleton = UsdSkel.Skeleton.Define(stage, path)
    skeleton.CreateJointsAttr(list(joints))
    skeleton.CreateBindTransformsAttr(row_matrices(bind))
    skeleton.CreateRestTransformsAttr(row_matrices(rest))
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim())
    return skeleton


def bind_to(skeleton: UsdSkel.Skeleton, prim: Usd.Prim, bind_place: np.ndarray) -> UsdSkel.BindingAPI:
    """Bind a prim, which stands at `bind_place` (4, 4) in the bind pose, to a skeleton."""
    binding = UsdSkel.BindingAPI.Apply(prim)
    binding.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    binding.CreateGeomBindTransformAttr(row_matrix(bind_place))
    return binding


def bind_rigidly(skeleton: UsdSkel.Skeleton, prim: Usd.Prim, bind_place: np.ndarray, joint: int) -> UsdSkel.BindingAPI:
    """`bind_to`, with the whole prim on one joint: of the skeleton, or of the binding's own joint list if it gets one."""
    binding = bind_to(skeleton, prim, bind_place)
    binding.CreateJointIndicesPrimvar(True, 1).Set([joint])
    binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])
    return binding


def author_influences(binding: UsdSkel.BindingAPI, indices: np.ndarray, weights: np.ndarray) -> None:
    """Write joint indices and weights (V, I) of a mesh's vertices."""
    width = indices.shape[1]
    binding.CreateJointIndicesPrimvar(False, width).Set(integers(indices))
    binding.CreateJointWeightsPrimvar(False, width).Set(floats(weights))
