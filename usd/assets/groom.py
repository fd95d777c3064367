# SPDX-License-Identifier: Apache-2.0
"""Write grooms as USD BasisCurves with the attributes that other tools read."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, Vt

from neuralocks_core.files import as_path
from neuralocks_core.groom import Groom
from neuralocks_core.strands.strand_set import root_uv

from ..baking.layer.header import RANGE, over_prim, write_header
from ..border.arrays import floats, integers, row_matrix
from ..border.stage_files import write_stage
from ..shot.strands.curve_ends import Beyond
from ..shot.strands.curves import find_curves
from ..skel.stage_rig import StageRig
from .curve_primvars import Beside
from .prims import POLYLINES, Spline, author_curves

BELOW = 0.02
"""The middle of a head is at least this far below the lowest root [m]."""


@dataclass(frozen=True)
class Authored:
    """A groom, with further attributes of the curves that it was read from.

    Attributes:
        groom: the strands.
        spline: how a renderer interpolates them.
        beside: what else the curves have.
        beyond: which of their points lie beyond the ends of what is drawn; None if all are drawn.
    """

    groom: Groom
    spline: Spline = POLYLINES
    beside: Beside = Beside()
    beyond: Beyond | None = None


@dataclass(frozen=True)
class Over:
    """A file that grooms are written over, so that the new file shows both.

    Attributes:
        rig: the character with the hair.
        path: its file.
        replaced: curves in it that the grooms replace; they are inactive in the new file.
    """

    rig: StageRig
    path: Path
    replaced: list[Usd.Prim] = field(default_factory=list)

    @property
    def stage(self) -> Usd.Stage:
        """The file's."""
        return self.rig.joints.prim.GetStage()

    def notes(self) -> list[str]:
        """The note on hair that the file has already, which new hair does not replace."""
        there = [prim for prim in find_curves(self.stage) if prim not in self.replaced]
        if not there:
            return []
        more = f" and {len(there) - 1} more" if len(there) > 1 else ""
        return [
            f"{there[0].GetPath()}{more}: {self.path.name} has this hair already, and a bake moves it beside the new; if the new hair "
            f"replaces it, add --replace {there[0].GetPath()}"
        ]

    def finish(self, layer: Sdf.Layer, out: Path) -> None:
        """Make a layer, to be found at `out`, one over the file."""
        codes = self.rig.time_codes[[0, -1]].tolist()
        write_header(layer, self.stage, self.rig.border, self.path, out, codes)
        for name in RANGE:
            if not self.stage.HasAuthoredMetadata(name):  # a range here would hide what animates the character later
                layer.pseudoRoot.ClearInfo(name)
        for prim in self.replaced:
            over_prim(layer, prim).active = False


def write_groom(path, groom: Groom, rig: StageRig | None = None, over: Over | None = None) -> Path:
    """Write one groom; see `write_grooms`."""
    return write_grooms(path, [Authored(groom)], rig, over)


def write_grooms(path, grooms: list[Authored], rig: StageRig | None = None, over: Over | None = None) -> Path:
    """Write grooms below a root prim, `/Groom` if that name is free; the file is complete once it has its final name.

    Args:
        path: USD file to write.
        grooms: in metres, Y up; in bind world, if there is a rig.
        rig: the character that the grooms are made for. They are placed on its bind pose as its stage shows that, in the unit and axis of
            its file; metres and Y up if left out.
        over: write a layer over this file.

    Raises:
        NeuralocksError: the path has another extension or cannot be written.
    """

    border = rig.border if rig else None
    place = np.eye(4) if rig is None else rig.bind_shown @ np.linalg.inv(rig.to_bind)

    def author(stage: Usd.Stage) -> None:
        UsdGeom.SetStageUpAxis(stage, border.up_axis if border else UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, border.metres_per_unit if border else 1.0)
        root = UsdGeom.Xform.Define(stage, _free_path(over.stage if over else stage, Sdf.Path("/"), "Groom", {}))
        if not np.array_equal(place, np.eye(4)):
            root.AddTransformOp().Set(row_matrix(place))
        Usd.ModelAPI(root).SetKind("component")
        stage.SetDefaultPrim(root.GetPrim())
        numbers: dict[str, int] = {}
        for each in grooms:
            free = _free_path(stage, root.GetPath(), each.groom.name, numbers)
            each.beside.author(author_groom(stage, free, each.groom, each.spline))

    path = as_path(path, "path")
    return write_stage(path, author, (lambda layer: over.finish(layer, path)) if over else None)


def author_groom(stage: Usd.Stage, path, groom: Groom, spline: Spline = POLYLINES) -> UsdGeom.BasisCurves:
    """Define a BasisCurves prim for a groom in a stage of metres, Y up.

    Unreal and other groom readers know the `groom_*` primvars. If a groom has no root UVs, they are guessed here from the direction
    of each root from the middle of the head; otherwise each reader would guess them in its own way.
    """
    curves = author_curves(stage, path, groom.points, groom.counts, groom.widths, spline)
    api = UsdGeom.PrimvarsAPI(curves)
    names, uniform = Sdf.ValueTypeNames, UsdGeom.Tokens.uniform

    def per_strand(name: str, kind, values) -> None:
        api.CreatePrimvar(name, kind, uniform).Set(values)

    per_strand("groom_id", names.IntArray, integers(np.arange(groom.strand_count)))
    if groom.guides is not None:
        per_strand("groom_guide", names.IntArray, integers(groom.guides))
    if groom.group is not None:
        per_strand("groom_group_id", names.IntArray, integers(groom.group))
    uv = _guessed_uv(groom) if groom.root_uv is None else groom.root_uv
    uv = Vt.Vec2fArray.FromNumpy(np.ascontiguousarray(uv))
    per_strand("groom_root_uv", names.Float2Array, uv)
    per_strand("st", names.TexCoord2fArray, uv)
    centimetres = floats(np.float32(100) * groom.widths)
    api.CreatePrimvar("groom_width", names.FloatArray, curves.GetWidthsInterpolation()).Set(centimetres)
    for name, kind, value in (
        ("groom_version_major", names.Int, 1),
        ("groom_version_minor", names.Int, 4),
        ("groom_tool", names.String, "neuralocks"),
    ):
        api.CreatePrimvar(name, kind, UsdGeom.Tokens.constant).Set(value)
    return curves


def _guessed_uv(groom: Groom) -> np.ndarray:
    """Root UVs (S, 2) as the network reads them, around the estimated middle of an unknown head."""
    roots = np.zeros((groom.strand_count, 3), np.float32)
    filled = groom.counts > 0
    roots[filled] = groom.points[groom.starts[filled]]
    low, high = roots[filled].min(axis=0), roots[filled].max(axis=0)
    centre = (low + high) / 2
    centre[1] = low[1] - BELOW  # hair grows on the upper half
    return root_uv(roots, centre)


def _free_path(stage: Usd.Stage, above: Sdf.Path, name: str, numbers: dict[str, int]) -> Sdf.Path:
    """An unused path of a prim for a name, which may be a file's without its extension, or a prim path. `numbers` holds the last one
    tried for each name: the next search goes on from there.
    """
    base = name.rsplit("/", 1)[-1] or "Hair"
    base = Tf.MakeValidIdentifier(f"_{base}" if base[0].isdecimal() else base)  # which would replace a digit
    path = above.AppendChild(base)
    while stage.GetPrimAtPath(path):
        numbers[base] = numbers.get(base, 1) + 1
        path = above.AppendChild(f"{base}_{numbers[base]}")
    return path
