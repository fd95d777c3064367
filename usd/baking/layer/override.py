# SPDX-License-Identifier: Apache-2.0
"""The override layer of a bake: sublayers the shot, and puts samples on the groom prims only."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, Vt

from neuralocks_core.rotation import sizes, transformed

from ...border.arrays import vectors
from ...border.damage import named
from ...border.stage_files import refresh_open
from ...border.stopping import check
from ...shot.bakes.bake_record import CARRIER, record
from ...shot.made_from import INPUTS, made_from
from ...shot.stage import Shot, StageGroom
from ...shot.strands.curves import rest_points, widest_sample
from ...skel.binding import FORMER, bound_skeleton
from .header import apply_binding, over_prim, write_header
from .sample_layer import SampleLayer
from .spool import Spool


class OverrideWriter:
    """Writes samples, in the order they come, to a crate file.

    The file's content depends only on the shot and the samples, not on date, machine or timing.

    Args:
        file: to write to.
        out: its final name, to which the shot's path is relative.
        shot: what is overridden.
        codes: all time codes of the bake.
    """

    def __init__(self, file: SampleLayer, out: Path, shot: Shot, codes: list[float]):
        self._file = file
        self._reach: dict[Sdf.Path, np.float32] = {}  # how far hair reaches beyond its points, in the prim's own units
        if not file.saved:
            with named(out):
                write_header(file.layer, shot.stage, shot.border, shot.path, out, codes)

    def groom(self, item: StageGroom, velocities: bool, facts: dict) -> None:
        """Begin a groom: write the overs, how it was made, and what keeps it from being skinned a second time."""
        layer, path = self._file.layer, item.prim.GetPath()
        self._reach[path] = max(
            np.float32(item.groom.widths.max() / 2 / _unit(item)), np.float32(widest_sample(item.prim) / 2)
        )
        if layer.GetAttributeAtPath(path.AppendProperty("points")):
            return  # done by the bake that this one resumes
        over = over_prim(layer, item.prim)
        record(over, {**facts, "joint": item.joint, INPUTS: made_from(item.attachment, item.groom)})
        _relate(over, CARRIER, item.attachment.rig.path)
        if skeleton := bound_skeleton(item.prim):  # perhaps of another character than the one that carries it
            # An explicit empty target list unbinds the prim; UsdSkel then leaves its points alone.
            apply_binding(over, item.prim)
            relation = Sdf.RelationshipSpec(over, "skel:skeleton", custom=False)
            relation.targetPathList.ClearEditsAndMakeExplicit()
            _relate(over, FORMER, skeleton)
        names = Sdf.ValueTypeNames
        Sdf.AttributeSpec(over, "extent", names.Float3Array)
        points = Sdf.AttributeSpec(over, "points", names.Point3fArray)
        if UsdGeom.BasisCurves(item.prim).GetPointsAttr().Get(Usd.TimeCode.Default()) is None:
            # Otherwise readers of the bake would take its first sample as the rest shape.
            points.default = vectors(_at_default(item))
        # The shot's own values do not fit the baked points: a renderer would blur by them.
        authored = {name for name in ("velocities", "accelerations") if item.prim.GetAttribute(name).HasAuthoredValue()}
        if velocities:
            Sdf.AttributeSpec(over, "velocities", names.Vector3fArray)
            authored.discard("velocities")
        for name in sorted(authored):
            Sdf.AttributeSpec(over, name, names.Vector3fArray).default = Sdf.ValueBlock()

    def sample(
        self, item: StageGroom, time_code: float, name: str, fill: Callable[[np.ndarray], Iterable[np.ndarray]]
    ) -> None:
        """Add one time sample of `points` (and of the extent with it) or `velocities`.

        Args:
            item: the groom.
            time_code: when.
            name: "points" or "velocities".
            fill: writes all P values to an array (P, 3) float32 and yields consecutive parts as they are ready, so that a large
                groom is in memory only once.
        """
        array, corners = Vt.Vec3fArray(item.point_count), []
        for part in fill(np.asarray(_Writable(array))):
            if name == "points":
                corners += _corners(part)
        values = {name: array}
        if name == "points":
            pad = self._reach[item.prim.GetPath()]
            low, high = _corners(np.array(corners))
            values = {"extent": vectors([low - pad, high + pad]), **values}
        self._file.put(item.prim.GetPath(), time_code, values)

    def close(self) -> None:
        """Write what is held."""
        self._file.close()


def deliver(spool: Spool) -> None:
    """Move an assembled layer to its final name, as text if the name asks for it; stages open in this process see it."""
    check()
    if spool.out.suffix.lower() == ".usda":
        text = spool.layer_path.with_suffix(".usda")
        with named(spool.out):
            Sdf.Layer.FindOrOpen(str(spool.layer_path)).Export(str(text))
        os.replace(text, spool.layer_path)
    spool.finish()
    refresh_open(spool.out)


class _Writable:
    """A new USD array that numpy can fill. USD itself only lets its arrays be read, and converting and copying data into them takes
    longer than writing it.
    """

    def __init__(self, array: Vt.Vec3fArray):
        self._array = array  # lives as long as numpy's view of this
        facts = np.asarray(array).__array_interface__
        self.__array_interface__ = {**facts, "data": (facts["data"][0], False)}


def _relate(over: Sdf.PrimSpec, name: str, path: str) -> None:
    """Point from a groom to another prim."""
    Sdf.RelationshipSpec(over, name, custom=True).targetPathList.explicitItems = [path]


def _corners(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest coordinates (3,) of points (P, 3)."""
    # Long rows are compared ten times as fast as triples.
    even = len(points) // 64 * 64
    rows = points[:even].reshape(-1, 192)
    parts = [points[even:]]
    if even:
        parts += [rows.min(axis=0).reshape(-1, 3), rows.max(axis=0).reshape(-1, 3)]
    few = np.concatenate(parts)
    return few.min(axis=0), few.max(axis=0)


def _at_default(item: StageGroom) -> np.ndarray:
    """Points at rest (P, 3) float32 of a groom that has none at the default time."""
    points, attachment = rest_points(item.prim), item.attachment
    if attachment.at_default is None:
        return points
    return transformed(points, np.linalg.inv(attachment.at_default) @ attachment.to_bind).astype(np.float32)


def _unit(item: StageGroom) -> float:
    """Length of a unit of the prim's own space [m]."""
    return float(abs(sizes(item.attachment.to_bind)))
