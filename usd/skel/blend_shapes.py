# SPDX-License-Identifier: Apache-2.0
"""Blend shapes of a skinned mesh, with the shapes that lie between rest and full weight.

A shape with inbetweens is linear from knot to knot of its weight. Each knot is kept as a separate shape, so that a body has
only shapes that add up by weight.
"""

import numpy as np
from pxr import Usd, UsdSkel

from neuralocks_core.errors import NeuralocksError

from ..border.values import as_names, as_numbers

Knots = dict[float, np.ndarray]
"""Weight -> offsets (V, 3) there, ascending; 1 is among them, 0 is rest."""


def read_blend_shapes(prim: Usd.Prim, count: int, notes: list[str]) -> dict[str, Knots]:
    """Blend shapes of a mesh with `count` points, in mesh space.

    Args:
        prim: the mesh.
        count: of its points.
        notes: what a user should know is added here.

    Raises:
        NeuralocksError: offsets do not fit the points or are not finite.
    """
    binding = UsdSkel.BindingAPI(prim)
    names = as_names(binding.GetBlendShapesAttr(), binding.GetBlendShapesAttr().Get())
    targets = binding.GetBlendShapeTargetsRel().GetTargets() if names else []
    if len(names) != len(targets):
        notes.append(
            f"{prim.GetPath()}: {len(names)} blend shape names for {len(targets)} targets; blend shapes left out"
        )
        return {}
    shapes = {}
    for name, target in zip(names, targets):
        shape = UsdSkel.BlendShape(prim.GetStage().GetPrimAtPath(target))
        offsets = shape.GetOffsetsAttr().Get() if shape else None
        if not offsets:
            notes.append(f"{prim.GetPath()}: blend shape '{name}' ({target}) is missing or empty; left out")
            continue
        offsets = as_numbers(shape.GetOffsetsAttr(), "vector3f[]", offsets)
        chosen = as_numbers(shape.GetPointIndicesAttr(), "int[]", shape.GetPointIndicesAttr().Get(), np.int64)
        knots = {1.0: _dense(offsets, chosen, count, target)}
        for between in shape.GetInbetweens():
            weight, offsets = between.GetWeight(), between.GetOffsets()
            if weight is None or not np.isfinite(weight) or weight in (0, 1) or not offsets:
                notes.append(f"{between.GetAttr().GetPath()}: has no weight of its own or no offsets; left out")
                continue
            offsets = as_numbers(between.GetAttr(), "vector3f[]", offsets)
            knots[float(weight)] = _dense(offsets, chosen, count, between.GetAttr().GetPath())
        shapes[name] = dict(sorted(knots.items()))
    return shapes


def knot_weights(meshes: list[dict[str, Knots]]) -> dict[str, list[float]]:
    """Ascending knots of each blend shape by name, of all the meshes that have it."""
    names = dict.fromkeys(name for shapes in meshes for name in shapes)
    return {name: sorted({knot for shapes in meshes for knot in shapes.get(name, ())}) for name in names}


def shares(weights: np.ndarray, knots: list[float]) -> np.ndarray:
    """How much of the offsets at each knot, (T, len(knots)), make the shape at weights (T,).

    Linear between neighbouring knots, of which rest is one; outside, the outermost line continues, as in UsdSkel.
    """
    points = np.array(sorted({0.0, *knots}))
    low = np.clip(np.searchsorted(points, weights, side="right") - 1, 0, len(points) - 2)
    part = (weights - points[low]) / (points[low + 1] - points[low])
    result = np.zeros((len(weights), len(points)))
    rows = np.arange(len(weights))
    result[rows, low], result[rows, low + 1] = 1 - part, part
    return result[:, points != 0]


def all_shares(weights: np.ndarray, knots: dict[str, list[float]]) -> np.ndarray:
    """The `shares` (T, B) of several shapes, one after the other, at the weights (T, len(knots)) of each."""
    each = (shares(column, own) for column, own in zip(weights.T, knots.values(), strict=True))
    return np.concatenate([np.zeros((len(weights), 0)), *each], axis=1)


def at_knot(shape: Knots, knot: float) -> np.ndarray:
    """Offsets (V, 3) of one mesh's shape at a knot that may be another mesh's."""
    return np.einsum("k,kvc->vc", shares(np.array([knot]), list(shape))[0], np.stack(list(shape.values())))


def _dense(offsets: np.ndarray, chosen: np.ndarray, count: int, path) -> np.ndarray:
    """Offsets of all points (count, 3), from those of the chosen points, if any are chosen."""
    if not np.isfinite(offsets).all():
        raise NeuralocksError(f"{path}: blend shape offsets hold NaN or infinity; repair it")
    if not len(chosen):
        if len(offsets) != count:
            raise NeuralocksError(f"{path}: {len(offsets)} offsets for {count} points; export the blend shape again")
        return offsets
    if len(chosen) != len(offsets) or not 0 <= chosen.min() <= chosen.max() < count:
        raise NeuralocksError(
            f"{path}: {len(offsets)} offsets and {len(chosen)} point indices do not fit {count} points; export the blend shape "
            "again"
        )
    dense = np.zeros((count, 3))
    dense[chosen] = offsets
    return dense
