# SPDX-License-Identifier: Apache-2.0
"""Skinned meshes as arrays: points in authored bind space, triangles, influences, blend shapes."""

from dataclasses import dataclass, field

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.mesh import inside_out
from neuralocks_core.rotation import transformed
from neuralocks_core.skinned_body import Body

from ..border.placement import Placement
from ..border.values import as_numbers
from .binding import bound_skeleton, geom_bind, in_effect, joint_influences, lineage, rest_value
from .blend_shapes import Knots, at_knot, read_blend_shapes
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


Skins = dict[str, list[Usd.Prim]]
"""Path of a skeleton -> the Mesh prims that it skins, in stage order."""


def find_skins(stage: Usd.Stage) -> Skins:
    """The skinned meshes of a stage, searched once: a set may have many more meshes than its characters."""
    found: Skins = {}
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
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
    outside = [mesh.prim for mesh in meshes if not any(above.IsA(UsdSkel.Root) for above in lineage(mesh.prim))]
    if not outside:
        return []
    typed = ((above, spec.typeName) for above in lineage(outside[0]) for spec in above.GetPrimStack())
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
    switches = _switches(prim)
    return any(_seen(switches, time) for time in _switched(switches) or {Usd.TimeCode.EarliestTime()})


def seen_in_turn(meshes: list[StageMesh]) -> list[str]:
    """The note on meshes that are hidden at times at which others of the same skeleton are seen, such as one hat of two."""
    switches = [_switches(mesh.prim) for mesh in meshes]
    times = sorted(set().union(*map(_switched, switches)))
    seen = np.array([[_seen(own, time) for time in times] for own in switches], bool).reshape(len(meshes), len(times))
    partly = [mesh.prim for mesh, own in zip(meshes, seen) if (seen.any(axis=0) & ~own).any()]
    if not partly:
        return []
    return [
        f"{_first(partly)}: hidden at times, but hair is kept out of it in all frames; deactivate it if hair need not keep clear of it"
    ]


def _switches(prim: Usd.Prim) -> list[Usd.Attribute]:
    """The visibility of a prim and of those above it."""
    return [UsdGeom.Imageable(above).GetVisibilityAttr() for above in lineage(prim) if above.IsA(UsdGeom.Imageable)]


def _switched(switches: list[Usd.Attribute]) -> set[float]:
    return {code for switch in switches for code in switch.GetTimeSamples()}


def _seen(switches: list[Usd.Attribute], time) -> bool:
    return all(switch.Get(time) != UsdGeom.Tokens.invisible for switch in switches)


def merged_body(meshes: list[StageMesh], to_bind: np.ndarray, knots: dict[str, list[float]]) -> Body | None:
    """All meshes as one Body.

    Args:
        meshes: what one skeleton skins.
        to_bind: authored bind space to bind world [m], (4, 4).
        knots: those of the blend shapes wanted, see `knot_weights`. Each is a shape of the Body.
    """
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


def _moves(attribute: Usd.Attribute, rest: np.ndarray) -> bool:
    """Whether points leave those at rest (V, 3) in the first, the middle or the last of their samples: some exporters write the same
    ones in each frame, up to rounding.
    """
    same = 1e-4 * np.ptp(rest, axis=0).max()
    times = attribute.GetTimeSamples()
    some = {times[0], times[len(times) // 2], times[-1]} if times else ()
    every = (np.asarray(attribute.Get(time), rest.dtype) for time in some)
    return any(points.shape != rest.shape or not np.abs(points - rest).max() <= same for points in every)


def _read(prim: Usd.Prim, source: JointSource, notes: list[str]) -> StageMesh | None:
    mesh, path = UsdGeom.Mesh(prim), prim.GetPath()
    points = as_numbers(mesh.GetPointsAttr(), "point3f[]", rest_value(mesh.GetPointsAttr()))
    if not len(points):
        notes.append(f"{path}: the mesh has no points; left out of the body")
        return None
    if not np.isfinite(points).all():
        raise NeuralocksError(f"{path}: the mesh's points hold NaN or infinity; repair it")
    if _moves(mesh.GetPointsAttr(), points):
        notes.append(
            f"{path}: its points move before skinning; hair is kept out of it as its points are at rest; export that motion as "
            "blend shapes"
        )
    triangles = _triangles(mesh, path, len(points))
    if inside_out(points, triangles):
        notes.append(f"{path}: the mesh is inside out, its faces were turned round; flip its normals to fix this")
        triangles = triangles[:, ::-1]
    method = in_effect(prim, "primvars:skel:skinningMethod")
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
