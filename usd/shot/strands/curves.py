# SPDX-License-Identifier: Apache-2.0
"""BasisCurves as a groom: rest points, counts, widths and root attributes."""

from contextlib import suppress

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from neuralocks_core import rest_copy
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.rotation import transformed

from ...border.prim_paths import prim_paths, some_paths
from ...border.values import as_numbers
from ...skel.binding import rest_primvar, rest_value
from ..bakes.bake_record import recorded

NONE = "none (no BasisCurves)"


def find_curves(stage: Usd.Stage, wanted=None) -> list[Usd.Prim]:
    """BasisCurves prims in stage order; only those `wanted` (paths; a parent stands for all below it).

    Raises:
        NeuralocksError: a wanted path is not a groom.
    """
    every = [p for p in stage.Traverse(Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.BasisCurves)]
    if not wanted:
        return every
    chosen = set()
    for text in prim_paths(wanted, "grooms"):
        if not Sdf.Path.IsValidPathString(text) or not text.startswith("/"):
            raise NeuralocksError(f"{text}: not a prim path; give an absolute one such as {some_paths(every, NONE)}")
        below = [p for p in every if p.GetPath().HasPrefix(text)]
        if not below:
            prim = stage.GetPrimAtPath(text)
            fact = f"is a {prim.GetTypeName() or 'prim'} without BasisCurves" if prim else "no such prim"
            if prim and prim.IsInPrototype():
                fact = "is what instances share"
            raise NeuralocksError(f"{text}: {fact}; the stage's grooms are: {some_paths(every, NONE)}")
        chosen.update(below)
    return [prim for prim in every if prim in chosen]


def without_points(prims: list[Usd.Prim]) -> dict[Usd.Prim, None]:
    """The curves that are empty, as keys in the order given, unless all are: exporters leave such prims behind, some by the thousand."""
    empty = {}
    for prim in prims:
        points = rest_value(UsdGeom.BasisCurves(prim).GetPointsAttr())
        if points is None or hasattr(points, "__len__") and not len(points):
            empty[prim] = None
    return empty if len(empty) < len(prims) else {}


def rest_points(prim: Usd.Prim) -> np.ndarray:
    """(P, 3) float32 points at rest in the prim's own space and units: those that Blender's live view kept, if any.

    Raises:
        NeuralocksError: there are none, or they do not have three coordinates.
    """
    attribute = UsdGeom.BasisCurves(prim).GetPointsAttr()
    points = as_numbers(attribute, "point3f[]", rest_value(attribute), np.float32)
    if not len(points):
        raise NeuralocksError(
            f"{prim.GetPath()}: the groom has no points; give it its rest shape as default-time points"
        )
    kept = _kept(prim)
    return points if kept is None else kept


def rest_counts(prim: Usd.Prim) -> np.ndarray:
    """Points of each strand at rest (S,)."""
    attribute = UsdGeom.BasisCurves(prim).GetCurveVertexCountsAttr()
    return as_numbers(attribute, "int[]", rest_value(attribute), np.int64)


def moment(prim: Usd.Prim) -> float | None:
    """Time code of the points at rest, if they are taken from one sample of a moving cache."""
    if _kept(prim) is not None:
        return None
    points = UsdGeom.BasisCurves(prim).GetPointsAttr()
    if points.Get(Usd.TimeCode.Default()) is not None or not points.ValueMightBeTimeVarying():
        return None
    return float(points.GetTimeSamples()[0])


def _begins_with_default(prim: Usd.Prim) -> bool:
    """Whether the points of a moving cache, which is no bake of ours, are also those at the default time, as sparse writers put it."""
    points = UsdGeom.BasisCurves(prim).GetPointsAttr()
    times, default = points.GetTimeSamples(), points.Get(Usd.TimeCode.Default())
    if _kept(prim) is not None or recorded(prim) or not times:
        return False
    # Half of the samples may be of a stop: one in the middle and the last one are enough.
    later = {times[len(times) // 2], times[-1]}
    return np.array_equal(default, points.Get(times[0])) and any(
        not np.array_equal(default, points.Get(time)) for time in later
    )


def lone_sample(prim: Usd.Prim) -> list[float]:
    """The time code at which an exporter wrote points that do not move, if it wrote them as a sample."""
    points = UsdGeom.BasisCurves(prim).GetPointsAttr()
    samples = [] if points.Get(Usd.TimeCode.Default()) is not None else points.GetTimeSamples()
    return samples if len(samples) == 1 else []


def left_as_they_are(prim: Usd.Prim) -> list[str]:
    """The notes on values that belong to the points at rest, which a bake does not carry along."""
    notes = []
    normals = UsdGeom.BasisCurves(prim).GetNormalsAttr(), prim.GetAttribute("primvars:normals")
    if any(each.HasAuthoredValue() for each in normals if each):
        notes.append(
            f"{prim.GetPath()}: has normals, which stay as they are at rest while the hair turns; "
            "remove them, so that it is drawn as tubes or facing the camera"
        )
    if UsdSkel.BindingAPI(prim).GetBlendShapeTargetsRel().GetTargets():
        notes.append(
            f"{prim.GetPath()}: has blend shapes of its own, which a bake leaves out; apply them to its points"
        )
    return notes


def read_groom(prim: Usd.Prim, to_bind: np.ndarray, notes: list[str]) -> Groom:
    """The groom at rest in bind-world metres.

    Args:
        prim: a BasisCurves.
        to_bind: the prim's own space to bind world [m], (4, 4).
        notes: what a user should know is added here.

    Raises:
        NeuralocksError: arrays do not fit each other, or are empty or not finite.
    """
    curves, path = UsdGeom.BasisCurves(prim), str(prim.GetPath())
    points = rest_points(prim)
    if _copy(prim):
        fact = "does not fit its points, which are moved already; export it with Live off"
        if _kept(prim) is not None:
            fact = (
                "is its shape at rest, without what modifiers do; to have its points instead, export it with Live off, or "
                "remove that primvar"
            )
        notes.append(f"{path}: was exported from Blender while Live was on; primvars:{rest_copy.NAME} {fact}")
    if (when := moment(prim)) is not None:
        notes.append(f"{path}: has no points at the default time; those at time code {when:g} are its shape at rest")
    elif _begins_with_default(prim):
        notes.append(
            f"{path}: its points change, and begin with those at the default time, which are taken as its shape at rest; if they are "
            "moved already, export it as it was groomed (from Blender, after Remove Hair Cache)"
        )
    counts = _steady_counts(prim)
    scale = float(np.cbrt(abs(np.linalg.det(to_bind[:3, :3]))))
    uv = _per_strand(prim, ("groom_root_uv", "surface_uv_coordinate", "st", "uv"), counts, 2)
    guides = _per_strand(prim, ("groom_guide",), counts, 1)
    group = _per_strand(prim, ("groom_group_id",), counts, 1)
    with np.errstate(invalid="ignore", over="ignore"):  # Groom says where a value is not finite
        placed = transformed(points, to_bind).astype(np.float32)
    return Groom(
        name=path,
        points=placed,
        counts=counts,
        widths=_widths(curves, counts, scale, notes),
        root_uv=None if uv is None else uv.astype(np.float32),
        guides=None if guides is None else guides > 0.5,
        group=None if group is None else group.astype(np.int32),
    )


def _kept(prim: Usd.Prim) -> np.ndarray | None:
    """(P, 3) float32 points at rest that the Blender add-on kept beside live ones; None if it did not, or not for all."""
    copy = _copy(prim)
    if copy is None:
        return None
    kept, points = np.asarray(rest_primvar(copy)), rest_value(UsdGeom.BasisCurves(prim).GetPointsAttr())
    if (
        kept.dtype != np.float32
        or kept.ndim != 2
        or kept.shape != np.shape(points)
        or rest_copy.never_written(kept).any()
    ):
        return None
    return kept


def _copy(prim: Usd.Prim) -> UsdGeom.Primvar | None:
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(rest_copy.NAME)
    return primvar if primvar and primvar.HasValue() else None


def _steady_counts(prim: Usd.Prim) -> np.ndarray:
    """Points of each strand (S,), which some caches write anew for each frame."""
    attribute, counts = UsdGeom.BasisCurves(prim).GetCurveVertexCountsAttr(), rest_counts(prim)
    for time in attribute.GetTimeSamples():
        if not np.array_equal(counts, attribute.Get(time)):
            raise NeuralocksError(
                f"{prim.GetPath()}: its curveVertexCounts at time code {time:g} are not those at rest; "
                "hair must keep its strands, remove the other samples"
            )
    return counts


def widest_sample(prim: Usd.Prim) -> float:
    """The largest of a groom's widths that change over time, in the prim's own units; 0 where none do."""
    attribute, widest = widths_attribute(UsdGeom.BasisCurves(prim)), 0.0
    for time in attribute.GetTimeSamples():
        with suppress(NeuralocksError):  # there is a note on widths of another type
            values = as_numbers(attribute, "float[]", attribute.Get(time), np.float32)
            widest = max(widest, float(values[np.isfinite(values)].max(initial=0)))
    return widest


def widths_attribute(curves: UsdGeom.BasisCurves) -> Usd.Attribute:
    """The widths that count: a primvar of that name hides the curves' own."""
    primvar = UsdGeom.PrimvarsAPI(curves).GetPrimvar("widths")
    return primvar.GetAttr() if primvar and primvar.HasValue() else curves.GetWidthsAttr()


def _widths(curves: UsdGeom.BasisCurves, counts: np.ndarray, scale: float, notes: list[str]) -> np.ndarray | None:
    """Widths [m] of points, strands or all: (P,), (S,) or (1,); None if the curves have none that make sense."""
    attribute = widths_attribute(curves)
    primvar = UsdGeom.Primvar(attribute)
    try:
        values = as_numbers(
            attribute, "float[]", rest_primvar(primvar) if primvar else rest_value(attribute), np.float32
        )
    except NeuralocksError as error:
        notes.append(f"{error}; they are left as they are")
        return None
    if not len(values):
        return None
    values = values * np.float32(scale)
    strands = len(counts)
    if np.isfinite(values).all() and (values >= 0).all():
        if len(values) in (1, strands, counts.sum()):
            return values
        for knots in _knots(curves, counts):
            if knots.sum() == len(values) and knots.min() > 0:
                # Strand i runs from 2 i to 2 i + 1.
                ends, places = (np.repeat(2.0 * np.arange(strands), each) + _places(each) for each in (knots, counts))
                return np.interp(places, ends, values).astype(np.float32)
    notes.append(
        f"{curves.GetPath()}: {len(values)} widths do not fit {strands} strands or are not finite; "
        "they are left as they are"
    )
    return None


def _knots(curves: UsdGeom.BasisCurves, counts: np.ndarray) -> list[np.ndarray]:
    """How many varying values each cubic strand has, (S,): one for every end of a segment. Of Catmull-Rom curves and
    B-splines of n points that is n - 2 values, also in pinned curves, where USD wants n.
    """
    if curves.GetTypeAttr().Get() != UsdGeom.Tokens.cubic:
        return []
    wrap = curves.GetWrapAttr().Get()
    if curves.GetBasisAttr().Get() == UsdGeom.Tokens.bezier:
        return [counts // 3 if wrap == UsdGeom.Tokens.periodic else (counts - 4) // 3 + 2]
    return [] if wrap == UsdGeom.Tokens.periodic else [counts - 2]


def _places(each: np.ndarray) -> np.ndarray:
    """Where values lie along their strands, each strand's evenly from 0 to 1; `each` (S,) is how many it has."""
    number = np.arange(each.sum()) - np.repeat(np.cumsum(each) - each, each)
    return number / np.repeat(np.maximum(each - 1, 1), each)


def _per_strand(prim: Usd.Prim, names, counts: np.ndarray, width: int) -> np.ndarray | None:
    """A primvar of each strand (S, width), or (S,) for width 1: the first of `names` that fits.

    One value counts for all strands; of values per vertex, which some tools write, the root's is taken.
    """
    api, strands = UsdGeom.PrimvarsAPI(prim), len(counts)
    for name in names:
        primvar = api.GetPrimvar(name)
        if not primvar or not primvar.HasValue():
            continue
        try:
            values = np.asarray(rest_primvar(primvar))
        except (TypeError, ValueError):
            continue
        if values.dtype.kind not in "biuf" or values.size % width or not np.isfinite(values).all():
            continue
        values = values.reshape(-1, width) if width > 1 else values.reshape(-1)
        if len(values) == 1:
            values = np.repeat(values, strands, axis=0)
        elif len(values) == counts.sum() != strands and counts.min() > 0:
            values = values[np.cumsum(counts) - counts]
        if len(values) == strands:
            return values
    return None
