# SPDX-License-Identifier: Apache-2.0
"""The override layer of a bake: sublayers the shot, and puts samples on the groom prims only."""

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdUtils, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import sizes

from .border import Border, first_line, transformed
from .curves import rest_points
from .recorded import record
from .stage import Shot, StageGroom

SAVE_EVERY = 32 << 20
"""Bytes of samples held before they are saved: memory does not grow with the number of frames."""


class OverrideWriter:
    """Writes samples, in the order they come, to a new crate file.

    What the file holds depends on nothing but the shot and the samples: no date, no machine, no timing.

    Args:
        part: file to write now.
        out: its final name, to which the shot's path is relative.
        shot: what is overridden.
        codes: all time codes of the bake.
    """

    def __init__(self, part: Path, out: Path, shot: Shot, codes: list[float]):
        self._out = out
        part.unlink(missing_ok=True)
        with _named(out):
            self._layer = Sdf.Layer.CreateNew(str(part), {"format": "usdc"})
            write_header(self._layer, shot.stage, shot.border, shot.path, out, codes)
        self._held = 0

    def groom(self, item: StageGroom, velocities: bool, facts: dict) -> None:
        """Open a groom: the overs, what it is made with, and what keeps it from being skinned a second time."""
        layer, path = self._layer, item.prim.GetPath()
        for above in path.GetPrefixes():
            if item.prim.GetStage().GetPrimAtPath(above).IsInstance():
                # What lies inside an instance cannot be overridden.
                _over(layer, above).instanceable = False
        over = _over(layer, path)
        record(over, facts)
        if item.attachment.skinned:
            # An explicit empty target list unbinds the prim; UsdSkel then leaves its points alone.
            if not item.prim.HasAPI("SkelBindingAPI"):
                over.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=["SkelBindingAPI"]))
            relation = Sdf.RelationshipSpec(over, "skel:skeleton", custom=False)
            relation.targetPathList.ClearEditsAndMakeExplicit()
        names = Sdf.ValueTypeNames
        Sdf.AttributeSpec(over, "extent", names.Float3Array)
        points = Sdf.AttributeSpec(over, "points", names.Point3fArray)
        if UsdGeom.BasisCurves(item.prim).GetPointsAttr().Get(Usd.TimeCode.Default()) is None:
            # Else the first baked sample would be the shape at rest to whoever reads the bake.
            points.default = Vt.Vec3fArray.FromNumpy(_at_default(item))
        # What the shot says of motion is not that of these points: a renderer would blur by it.
        authored = {name for name in ("velocities", "accelerations") if item.prim.GetAttribute(name).HasAuthoredValue()}
        if velocities:
            Sdf.AttributeSpec(over, "velocities", names.Vector3fArray)
            authored.discard("velocities")
        for name in sorted(authored):
            Sdf.AttributeSpec(over, name, names.Vector3fArray).default = Sdf.ValueBlock()

    def sample(self, item: StageGroom, time_code: float, name: str, blocks: Iterable[np.ndarray]) -> None:
        """Add one time sample of `points` (and of the extent with it) or `velocities`.

        Args:
            item: the groom.
            time_code: when.
            name: "points" or "velocities".
            blocks: consecutive parts (n, 3) float32 of all P values: a large groom's are never all there twice.
        """
        array, first, corners = Vt.Vec3fArray(len(item.groom.points)), 0, []
        inside = np.asarray(_Writable(array))
        for block in blocks:
            inside[first : first + len(block)] = block
            first += len(block)
            if name == "points":
                corners += _corners(block)
        with _named(self._out):
            if name == "points":
                pad = np.float32(item.groom.widths.max() / 2 / _unit(item))
                low, high = _corners(np.array(corners))
                self._set(item, time_code, "extent", Vt.Vec3fArray.FromNumpy(np.stack([low - pad, high + pad])))
            self._set(item, time_code, name, array)
            if self._held >= SAVE_EVERY:
                self._save()

    def _set(self, item: StageGroom, time_code: float, name: str, array: Vt.Vec3fArray) -> None:
        self._layer.SetTimeSample(item.prim.GetPath().AppendProperty(name), float(time_code), array)
        self._held += 12 * len(array)

    def close(self) -> None:
        """Write what is held."""
        with _named(self._out):
            self._save()
        self._layer = None

    def _save(self) -> None:
        self._layer.Save()
        self._held = 0


def write_header(layer: Sdf.Layer, stage: Usd.Stage, border: Border, shot: Path, out: Path, codes: list[float]) -> None:
    """Sublayer the shot by a path relative to `out`, and repeat what USD reads of a stage's first layer only."""
    root = layer.pseudoRoot
    _repeat_metadata(stage.GetRootLayer(), layer, out)
    layer.subLayerPaths.append(_relative(shot, out.parent))
    root.SetInfo("metersPerUnit", border.metres_per_unit)
    root.SetInfo("upAxis", border.up_axis)
    layer.timeCodesPerSecond = border.rate
    layer.framesPerSecond = stage.GetFramesPerSecond()
    ranged = stage.HasAuthoredTimeCodeRange()
    layer.startTimeCode = stage.GetStartTimeCode() if ranged else codes[0]
    layer.endTimeCode = stage.GetEndTimeCode() if ranged else codes[-1]
    if not stage.GetDefaultPrim():  # else it is repeated as the shot has it, which may be a path
        layer.defaultPrim = next(iter(stage.GetPseudoRoot().GetChildren())).GetName()


LAYERS_OWN = {"subLayers", "subLayerOffsets", "layerRelocates", "comment", "documentation", "owner", "sessionOwner"}
"""Metadata that is said of one layer, or that USD reads of sublayers, too."""


def _repeat_metadata(source: Sdf.Layer, layer: Sdf.Layer, out: Path) -> None:
    """Units, rates, range, default prim, render settings, and the variables without which references find nothing."""
    for name in sorted(source.pseudoRoot.ListInfoKeys()):  # USD gives another order in each process
        if name not in LAYERS_OWN:
            layer.pseudoRoot.SetInfo(name, source.pseudoRoot.GetInfo(name))

    def placed(asset: str) -> str:
        return _relative(source.ComputeAbsolutePath(asset), out.parent) if asset.startswith(("./", "../")) else asset

    UsdUtils.ModifyAssetPaths(layer, placed)


def _relative(file, folder: Path) -> str:
    """Path of a file relative to a folder, by the names it was given.

    What a shot refers to is found from its own folder, not from where a link in its path leads. Where the
    folder's own path has a link, `..` must lead to the file both from there and from behind the link.
    """
    behind = os.path.realpath(folder)
    try:
        ways = [
            os.path.relpath(os.path.abspath(file), os.path.abspath(folder)),
            os.path.relpath(os.path.realpath(file), behind),
        ]
    except ValueError:  # another drive
        return os.path.realpath(file).replace(os.sep, "/")
    leading = (way for way in ways if all(_same(f"{start}/{way}", file) for start in (os.path.abspath(folder), behind)))
    relative = next(leading, ways[0]).replace(os.sep, "/")
    return relative if relative.startswith("../") else f"./{relative}"


def _same(path: str, file) -> bool:
    """Whether a path, read as USD does, without a look at links before `..`, is the file."""
    try:
        return os.path.samefile(os.path.normpath(path), file)
    except OSError:
        return False


def to_text(crate: Path, text: Path, out: Path) -> None:
    """Convert an assembled crate file to .usda."""
    with _named(out):
        layer = Sdf.Layer.FindOrOpen(str(crate))
        layer.Export(str(text))


def reload_open(path: Path) -> None:
    """Let stages that this process has open see the file that has just been replaced."""
    layer = Sdf.Layer.Find(os.path.realpath(path)) or Sdf.Layer.Find(str(path))
    if layer:
        layer.Reload(force=True)


class _Writable:
    """A new USD array as numpy may fill it. USD itself lets its arrays be read only, and to convert and copy what goes into
    them costs more than to write them.
    """

    def __init__(self, array: Vt.Vec3fArray):
        self._array = array  # lives as long as what numpy makes of this
        facts = np.asarray(array).__array_interface__
        self.__array_interface__ = {**facts, "data": (facts["data"][0], False)}


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


def _over(layer: Sdf.Layer, path: Sdf.Path) -> Sdf.PrimSpec:
    return layer.GetPrimAtPath(path) or Sdf.CreatePrimInLayer(layer, path)


def _unit(item: StageGroom) -> float:
    """Length of a unit of the prim's own space [m]."""
    return float(abs(sizes(item.attachment.to_bind)))


class _named:
    """Turns USD's errors into one line that names the output."""

    def __init__(self, out: Path):
        self._out = out

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is not None and issubclass(kind, Tf.ErrorException):
            raise NeuralocksError(
                f"{self._out}: cannot be written ({first_line(error)}); check the folder and the space on its disk"
            ) from None
        return False
