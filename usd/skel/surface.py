# SPDX-License-Identifier: Apache-2.0
"""Skinned meshes as arrays: points in authored bind space, triangles, influences, blend shapes."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.mesh import inside_out
from neuralocks_core.rotation import transformed
from neuralocks_core.skinned_body import Body

from ..border.arrays import column_matrix
from ..border.placement import Placement
from ..border.values import as_names, as_numbers
from .blend_shapes import Knots, at_knot, knot_weights, read_blend_shapes
from .joints import JointSource


@dataclass(frozen=True)
class StageMesh:
    """One mesh that follows a skeleton.

    Attributes:
        prim: the Mesh.
        geom_bind: mesh space to authored bind space, (4, 4).
        points: (V, 3), mesh space at rest.
        triangles: (F, 3) int, outward.
        indices, weights: (V, I), joints of the skeleton and their shares; rows sum to one.
        shapes: blend shape name -> its knots, mesh space.
        placement: where the prim itself stands.
    """

    prim: Usd.Prim
    geom_bind: np.ndarray
    points: np.ndarray
    triangles: np.ndarray
    indices: np.ndarray
    weights: np.ndarray
    shapes: dict[str, Knots] = field(repr=False)
    placement: Placement = field(repr=False)

    def in_bind(self, to_bind: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (V, 3) [m] and outward triangles (F, 3) in bind world, by its rig's way there (4, 4)."""
        matrix = to_bind @ self.geom_bind
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        return transformed(self.points, matrix), self.triangles[:, ::-1] if mirrored else self.triangles


FORMER = "neuralocks:skeleton"
"""A relationship to the skeleton from which a bake unbound a prim: in flattened layers, the only trace of it."""
Skins = dict[str, list[Usd.Prim]]
"""Path of a skeleton -> the Mesh prims that it skins, in stage order."""


def find_skins(stage: Usd.Stage) -> Skins:
    """The skinned meshes of a stage, searched once: a set may have many more meshes than its characters."""
    found: Skins = {}
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        if prim.IsA(UsdGeom.Mesh) and (skeleton := bound_skeleton(prim)) is not None:
            found.setdefault(skeleton, []).append(prim)
    return found


def bound_meshes(skins: Skins, source: JointSource, notes: list[str]) -> list[StageMesh]:
    """Visible meshes that the skeleton skins, in stage order.

    Raises:
        NeuralocksError: a mesh's arrays do not fit each other or are not finite.
    """
    read = (_read(prim, source, notes) for prim in skins.get(source.path, ()) if drawn(prim))
    return [mesh for mesh in read if mesh is not None]


def not_posed(meshes: list[StageMesh], source: JointSource) -> list[str]:
    """The notes on meshes that USD draws as they were made, whatever their skeleton does, because they have no SkelRoot above, or
    because the schema of their binding is not applied.
    """
    unapplied = [mesh.prim for mesh in meshes if not UsdSkel.BindingAPI(mesh.prim).GetInheritedSkeleton()]
    if unapplied:
        return [
            f"{source.path}: SkelBindingAPI is not applied to {_first(unapplied)}, so USD draws it as modelled, whatever the "
            "skeleton does; add it to the apiSchemas of what has the skel:skeleton"
        ]
    outside = [mesh.prim for mesh in meshes if not any(above.IsA(UsdSkel.Root) for above in _lineage(mesh.prim))]
    if not outside:
        return []
    typed = ((above, spec.typeName) for above in _lineage(outside[0]) for spec in above.GetPrimStack())
    # A reference to a SkelRoot on a prim that is defined with a type of its own.
    hidden = next((above for above, name in typed if name == "SkelRoot"), None)
    common = source.prim.GetParent().GetPath().GetCommonPrefix(outside[0].GetParent().GetPath())
    remedy = f"make {common} a SkelRoot" if common != Sdf.Path.absoluteRootPath else "put both below a SkelRoot"
    if hidden:
        kind = hidden.GetTypeName()
        remedy = f"{hidden.GetPath()} is one below a stronger opinion that types it {kind}: type it SkelRoot there"
    return [
        f"{source.path}: no SkelRoot is above {_first(outside)}, so USD draws it as modelled, whatever the skeleton does; {remedy}"
    ]


def moved_joints(meshes: list[StageMesh], count: int) -> np.ndarray:
    """Which of a skeleton's joints (J,) bool move any vertex."""
    result = np.zeros(count, bool)
    for mesh in meshes:
        result[mesh.indices[mesh.weights > 0]] = True
    return result


def _first(prims: list[Usd.Prim]) -> str:
    return f"{prims[0].GetPath()} and {len(prims) - 1} more" if prims[1:] else str(prims[0].GetPath())


def drawn(prim: Usd.Prim) -> bool:
    """Whether a renderer shows the prim, at any time."""
    imageable, unseen = UsdGeom.Imageable(prim), (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy)
    return imageable.ComputePurpose() not in unseen and ever_visible(prim)


def ever_visible(prim: Usd.Prim) -> bool:
    """Whether the prim is seen at any time: a character that comes into the shot has its body before, too."""
    switches = [
        UsdGeom.Imageable(above).GetVisibilityAttr() for above in _lineage(prim) if above.IsA(UsdGeom.Imageable)
    ]
    times = {code for switch in switches for code in switch.GetTimeSamples()} or {Usd.TimeCode.EarliestTime()}
    return any(all(switch.Get(time) != UsdGeom.Tokens.invisible for switch in switches) for time in times)


def bound_skeleton(prim: Usd.Prim) -> str | None:
    """Path of the skeleton that skins this prim by its own or an inherited binding, or did before a bake unbound it."""
    if influences(prim)[0] is None:
        return None
    skeleton = UsdSkel.BindingAPI(prim).GetInheritedSkeleton()
    if skeleton:
        return str(skeleton.GetPath())
    relation = prim.GetRelationship("skel:skeleton")
    specs = relation.GetPropertyStack() if relation else []
    for target in (target for spec in specs for target in spec.targetPathList.GetAddedOrExplicitItems()):
        if UsdSkel.Skeleton(prim.GetStage().GetPrimAtPath(target)):
            return str(target)
    # A layer that unbinds and moves the points is a bake; the binding that it ended may be of a prim above.
    if any(spec.layer.GetNumTimeSamplesForPath(spec.path.ReplaceName("points")) for spec in specs):
        skeleton = UsdSkel.BindingAPI(prim.GetParent()).GetInheritedSkeleton()
    if not skeleton and (former := prim.GetRelationship(FORMER)):
        targets = (prim.GetStage().GetPrimAtPath(path) for path in former.GetTargets())
        skeleton = next(filter(None, map(UsdSkel.Skeleton, targets)), None)
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
    listed = _in_effect(prim, "skel:joints")
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
    """Transform (4, 4) from the prim's points to authored bind space."""
    authored = _in_effect(prim, "primvars:skel:geomBindTransform")
    matrix = np.eye(4)
    if authored:
        matrix = column_matrix(as_numbers(authored, "matrix4d", rest_value(authored)))
    if not np.isfinite(matrix).all() or abs(np.linalg.det(matrix[:3, :3])) < 1e-18:
        raise NeuralocksError(f"{prim.GetPath()}: its geomBindTransform is not finite or flat; bind it again")
    return matrix


def _in_effect(prim: Usd.Prim, name: str) -> Usd.Attribute | None:
    """A binding property with a value: the prim's own, otherwise that of the nearest prim above with a binding, as in UsdSkel."""
    for above in _lineage(prim):
        attribute = above.GetAttribute(name)
        if attribute and (above == prim or above.HasAPI(UsdSkel.BindingAPI)):
            if attribute.HasAuthoredValue() and rest_value(attribute) is not None:
                return attribute
    return None


def _lineage(prim: Usd.Prim) -> Iterator[Usd.Prim]:
    """A prim, and all above it."""
    while prim and not prim.IsPseudoRoot():
        yield prim
        prim = prim.GetParent()


def merged_body(meshes: list[StageMesh], to_bind: np.ndarray, keep: set[str] | None = None) -> Body | None:
    """All meshes as one Body.

    Args:
        meshes: what one skeleton skins.
        to_bind: authored bind space to bind world [m], (4, 4).
        keep: blend shapes wanted; all if None. Each of their knots is a shape of the Body.
    """
    knots = knot_weights([mesh.shapes for mesh in meshes])
    knots = {name: own for name, own in knots.items() if keep is None or name in keep}
    return Body.joined([_body(mesh, to_bind, knots) for mesh in meshes])


def _body(mesh: StageMesh, to_bind: np.ndarray, knots: dict[str, list[float]]) -> Body:
    """One mesh as a Body; `knots` are those of the blend shapes wanted, of all meshes."""
    turn = (to_bind @ mesh.geom_bind)[:3, :3]
    shapes = {
        name if knot == 1 else f"{name} at {knot:g}": at_knot(mesh.shapes[name], knot) @ turn.T
        for name in knots
        if name in mesh.shapes
        for knot in knots[name]
    }
    return Body(*mesh.in_bind(to_bind), mesh.indices, mesh.weights, shapes)


def _read(prim: Usd.Prim, source: JointSource, notes: list[str]) -> StageMesh | None:
    mesh, path = UsdGeom.Mesh(prim), prim.GetPath()
    points = as_numbers(mesh.GetPointsAttr(), "point3f[]", rest_value(mesh.GetPointsAttr()))
    if not len(points):
        notes.append(f"{path}: the mesh has no points; left out of the body")
        return None
    if not np.isfinite(points).all():
        raise NeuralocksError(f"{path}: the mesh's points hold NaN or infinity; repair it")
    triangles = _triangles(mesh, path, len(points))
    if inside_out(points, triangles):
        notes.append(f"{path}: the mesh is inside out, its faces were turned round; flip its normals to fix this")
        triangles = triangles[:, ::-1]
    method = _in_effect(prim, "primvars:skel:skinningMethod")
    if method and rest_value(method) == UsdSkel.Tokens.dualQuaternion:
        notes.append(
            f"{path}: its skinningMethod is dualQuaternion; hair is kept out of it as classicLinear poses it, which is thinner "
            "where joints twist or bend; check the hair there"
        )
    indices, weights = joint_influences(prim, len(points), source)
    shapes = read_blend_shapes(prim, len(points), notes)
    return StageMesh(
        prim=prim,
        geom_bind=geom_bind(prim),
        points=points,
        triangles=triangles,
        indices=indices,
        weights=weights,
        shapes=shapes,
        placement=Placement(prim),
    )


def rest_value(attribute: Usd.Attribute):
    """The default-time value, otherwise the earliest sample."""
    value = attribute.Get(Usd.TimeCode.Default())
    return attribute.Get(Usd.TimeCode.EarliestTime()) if value is None else value


def rest_primvar(primvar: UsdGeom.Primvar):
    """Like `rest_value`, with one value for each element."""
    value = primvar.ComputeFlattened(Usd.TimeCode.Default())
    return primvar.ComputeFlattened(Usd.TimeCode.EarliestTime()) if value is None else value


def _triangles(mesh: UsdGeom.Mesh, path, count: int) -> np.ndarray:
    faces, corners = (
        as_numbers(attribute, "int[]", rest_value(attribute), np.int64)
        for attribute in (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr())
    )
    if faces.size and faces.min() < 0 or faces.sum() != len(corners):
        raise NeuralocksError(f"{path}: face counts sum to {faces.sum()} for {len(corners)} corners; repair the mesh")
    if corners.size and not 0 <= corners.min() <= corners.max() < count:
        raise NeuralocksError(f"{path}: a face names a point outside 0..{count - 1}; repair the mesh")
    starts = np.cumsum(faces) - faces
    fans = np.maximum(faces - 2, 0)
    first = np.repeat(starts, fans)
    step = np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans)
    triangles = np.stack([corners[first], corners[first + step + 1], corners[first + step + 2]], axis=1)
    return triangles[:, ::-1] if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded else triangles
