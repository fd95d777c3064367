# SPDX-License-Identifier: Apache-2.0
"""How a prim is bound to a skeleton: which one, by which influences, from where; and the values that hold at rest."""

from collections.abc import Iterator

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError

from ..border.arrays import column_matrix
from ..border.values import as_names, as_numbers
from .joints import JointSource

FORMER = "neuralocks:skeleton"
"""A relationship to the skeleton from which a bake unbound a prim: in flattened layers, the only trace of it."""


def bound_skeleton(prim: Usd.Prim) -> str | None:
    """Path of the skeleton that skins this prim by its own or an inherited binding, or did before a bake unbound it."""
    if influences(prim)[0] is None:
        return None
    skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton()
    if skeleton:
        return str(skeleton.GetPath())
    if former := prim.GetRelationship(FORMER):
        # Unlike the targets of single specs below, its own are where references and inherits take them.
        targets = (prim.GetStage().GetPrimAtPath(path) for path in former.GetTargets())
        if skeleton := next(filter(None, map(UsdSkel.Skeleton, targets)), None):
            return str(skeleton.GetPath())
    relation = prim.GetRelationship("skel:skeleton")
    specs = relation.GetPropertyStack() if relation else []
    for target in (target for spec in specs for target in spec.targetPathList.GetAddedOrExplicitItems()):
        if UsdSkel.Skeleton(prim.GetStage().GetPrimAtPath(target)):
            return str(target)
    # A layer that unbinds and moves the points is a bake; the binding that it ended may be of a prim above.
    if any(spec.layer.GetNumTimeSamplesForPath(spec.path.ReplaceName("points")) for spec in specs):
        skeleton = UsdSkel.BindingAPI(prim.GetParent()).GetInheritedSkeleton()
    return str(skeleton.GetPath()) if skeleton else None


def influences(prim: Usd.Prim) -> tuple[UsdGeom.Primvar | None, UsdGeom.Primvar | None]:
    """The primvars of joint indices and weights in effect on a prim; inherited ones too, as in UsdSkel."""
    api = UsdGeom.PrimvarsAPI(prim)
    pair = [api.FindPrimvarWithInheritance(f"skel:joint{part}") for part in ("Indices", "Weights")]
    return tuple(pair) if all(p and p.HasValue() for p in pair) else (None, None)


def joint_influences(prim: Usd.Prim, count: int, source: JointSource) -> tuple[np.ndarray, np.ndarray]:
    """Indices into the skeleton and weights, each (count, I), of a skinned prim with `count` points.

    Raises:
        NeuralocksError: they do not fit the points or the skeleton.
    """
    path = prim.GetPath()
    primvars = influences(prim)
    size = max(int(primvars[0].GetElementSize()), 1)
    indices = as_numbers(primvars[0].GetAttr(), "int[]", rest_primvar(primvars[0]), int)
    weights = as_numbers(primvars[1].GetAttr(), "float[]", rest_primvar(primvars[1]))
    rows = 1 if primvars[0].GetInterpolation() == "constant" else count
    if len(indices) != rows * size or len(weights) != rows * size:
        raise NeuralocksError(
            f"{path}: {len(indices)} joint indices and {len(weights)} weights for {rows} points of {size}; "
            "export the skin again"
        )
    listed = in_effect(prim, "skel:joints")
    order = (as_names(listed, rest_value(listed)) if listed else ()) or source.names
    unknown = [name for name in order if name not in source.names]
    if unknown:
        raise NeuralocksError(
            f"{path}: skel:joints names '{unknown[0]}', which {source.path} does not have; bind it again"
        )
    if indices.size and not 0 <= indices.min() <= indices.max() < len(order):
        raise NeuralocksError(f"{path}: a joint index lies outside 0..{len(order) - 1}; bind it again")
    if not np.isfinite(weights).all() or (weights < 0).any():
        raise NeuralocksError(f"{path}: joint weights hold NaN, infinity or a negative value; bind it again")
    place = {name: i for i, name in enumerate(source.names)}
    indices = np.array([place[name] for name in order])[indices].reshape(rows, size)
    weights = weights.reshape(rows, size)
    total = weights.sum(axis=1, keepdims=True)
    weights = np.where(total > 1e-9, weights / np.maximum(total, 1e-9), np.eye(1, size))
    return np.broadcast_to(indices, (count, size)), np.broadcast_to(weights, (count, size))


def geom_bind(prim: Usd.Prim) -> np.ndarray:
    """Transform (4, 4) from the prim's points to authored bind space.

    Raises:
        NeuralocksError: it is not finite, or flat.
    """
    authored = in_effect(prim, "primvars:skel:geomBindTransform")
    matrix = np.eye(4)
    if authored:
        matrix = column_matrix(as_numbers(authored, "matrix4d", rest_value(authored)))
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-18:
        raise NeuralocksError(f"{prim.GetPath()}: its geomBindTransform is not finite or flat; bind it again")
    return matrix


def rest_value(attribute: Usd.Attribute):
    """The default-time value, otherwise the earliest sample."""
    value = attribute.Get(Usd.TimeCode.Default())
    return attribute.Get(Usd.TimeCode.EarliestTime()) if value is None else value


def rest_primvar(primvar: UsdGeom.Primvar):
    """Like `rest_value`, with one value for each element."""
    value = primvar.ComputeFlattened(Usd.TimeCode.Default())
    return primvar.ComputeFlattened(Usd.TimeCode.EarliestTime()) if value is None else value


def in_effect(prim: Usd.Prim, name: str) -> Usd.Attribute | None:
    """A binding property with a value: the prim's own, otherwise that of the nearest prim above with a binding, as in UsdSkel."""
    for above in lineage(prim):
        attribute = above.GetAttribute(name)
        if attribute and (above == prim or above.HasAPI(UsdSkel.BindingAPI)):
            if attribute.HasAuthoredValue() and rest_value(attribute) is not None:
                return attribute
    return None


def lineage(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    """A prim, and all above it."""
    while prim and not prim.IsPseudoRoot():
        yield prim
        prim = prim.GetParent()
