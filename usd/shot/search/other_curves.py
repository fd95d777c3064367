# SPDX-License-Identifier: Apache-2.0
"""Hair that a bake leaves out: curves of other types beside BasisCurves, and curves that are only drawn as copies."""

from collections.abc import Sequence

import numpy as np
from pxr import Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import transformed

from ...border.placement import Placement, Unplaced
from ...border.values import as_numbers
from ...skel.binding import lineage, rest_value
from ...skel.keys import changes
from ...skel.stage_rig import StageRig
from ..carriers.attach import REACH
from ..carriers.seat import NEAR
from ..carriers.ways import ways

MOST = 200
"""Most prims that are looked at: a rig may have thousands of such curves as controls."""
SOME_ROOTS = 50
"""About how many of a prim's curves are looked at."""


def other_hair(rigs: Sequence[StageRig]) -> list[str]:
    """A line for each prim of NURBS or Hermite curves that looks like hair: on a skin, or several curves near a head."""
    if not rigs:
        return []
    others = _others(rigs[0].joints.prim.GetStage())
    return [_left_out(prim) for prim in others[:MOST] if _looks_like_hair(prim, rigs)]


def of_other_kinds(stage: Usd.Stage) -> list[str]:
    """A line for each prim of NURBS or Hermite curves in a file of hair."""
    return [_left_out(prim) for prim in _others(stage)]


def _others(stage: Usd.Stage) -> list[Usd.Prim]:
    every = stage.Traverse(Usd.TraverseInstanceProxies())
    return [prim for prim in every if prim.IsA(UsdGeom.NurbsCurves) or prim.IsA(UsdGeom.HermiteCurves)]


def _left_out(prim: Usd.Prim) -> str:
    return f"{prim.GetPath()}: its {prim.GetTypeName()} are left out; if they are hair, convert them to BasisCurves"


def drawn_as_copies(prims: Sequence[Usd.Prim]) -> tuple[dict[Usd.Prim, str], list[str]]:
    """The curves among these that are only drawn as copies, by a point instancer above them, with a line on each. Curves that it
    copies together with their character are hair like any other, with a note on each instancer that moves its copies.
    """
    found, moved, characters = {}, {}, {}
    for prim in prims:
        above = next((each for each in lineage(prim) if each.IsA(UsdGeom.PointInstancer)), None)
        if above is None:
            continue
        kinds = UsdGeom.PointInstancer(above).GetPrototypesRel().GetTargets()
        kind = next((path for path in kinds if prim.GetPath().HasPrefix(path)), prim.GetPath())
        if kind not in characters:
            below = Usd.PrimRange(prim.GetStage().GetPrimAtPath(kind), Usd.TraverseInstanceProxies())
            characters[kind] = any(other.IsA(UsdSkel.Skeleton) for other in below)
        if not characters[kind]:
            found[prim] = (
                f"{prim.GetPath()}: is drawn as copies by the PointInstancer {above.GetPath()}, which no bake moves; if they are hair, "
                "make each copy curves of its own"
            )
        elif above not in moved:
            moved[above] = _moves_copies(UsdGeom.PointInstancer(above))
    return found, [
        f"{above.GetPath()}: moves its copies of a character over time, which their hair does not feel; if they walk, make each a "
        "character of its own"
        for above in moved
        if moved[above]
    ]


def _moves_copies(instancer: UsdGeom.PointInstancer) -> bool:
    places = instancer.GetPositionsAttr(), instancer.GetOrientationsAttr(), instancer.GetOrientationsfAttr()
    speeds = instancer.GetVelocitiesAttr(), instancer.GetAngularVelocitiesAttr()
    return any(changes(attribute.GetTimeSamples(), attribute.Get) for attribute in places) or any(
        np.any(attribute.Get(Usd.TimeCode.EarliestTime()) or 0) for attribute in speeds
    )


def _looks_like_hair(prim: Usd.Prim, rigs: Sequence[StageRig]) -> bool:
    roots = _roots(prim)
    try:
        return bool(len(roots)) and _lies_like_hair(roots, Placement(prim), rigs)
    except Unplaced:  # for example hidden by a scale of zero, at first or for a while
        return False


def _lies_like_hair(roots: np.ndarray, placement: Placement, rigs: Sequence[StageRig]) -> bool:
    for rig in rigs:
        for mesh, skin in zip(rig.meshes, rig.skins, strict=True):
            for way in ways(rig, mesh, placement):
                if np.median(skin.query(transformed(roots, way), 2 * NEAR)[0]) <= NEAR:
                    return True
        if len(roots) > 1 and "head" in rig.character.humanoid:
            head = rig.character.canonical_to_bind[:3, 3]
            away = [
                np.median(np.linalg.norm(transformed(roots, way) - head, axis=1)) for way in ways(rig, None, placement)
            ]
            if min(away) <= REACH:
                return True
    return False


def _roots(prim: Usd.Prim) -> np.ndarray:
    """First points (n, 3) of some curves, without closed ones, as a rig's controls are; none if points are odd."""
    curves = UsdGeom.Curves(prim)
    attributes = curves.GetPointsAttr(), curves.GetCurveVertexCountsAttr()
    try:
        points, counts = (
            as_numbers(attribute, wanted, rest_value(attribute), kind)
            for attribute, wanted, kind in zip(attributes, ("point3f[]", "int[]"), (float, np.int64))
        )
    except NeuralocksError:
        return np.zeros((0, 3))
    if counts.sum() != len(points) or counts.min(initial=1) < 1 or not np.isfinite(points).all():
        return np.zeros((0, 3))
    some = slice(None, None, max(1, len(counts) // SOME_ROOTS))
    first, counts = (np.cumsum(counts) - counts)[some], counts[some]
    back = [(points[low + 1 : low + count] == points[low]).all(axis=1).any() for low, count in zip(first, counts)]
    return points[first[~np.array(back, bool)]]
