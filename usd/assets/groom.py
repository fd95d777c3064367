# SPDX-License-Identifier: Apache-2.0
"""Write grooms as USD BasisCurves with the attributes that other tools read, and import them from any file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.formats.look import Look
from neuralocks_core.formats.units import metres_per_unit, upward_axis
from neuralocks_core.groom import Groom
from neuralocks_core.strands.strand_set import root_uv

from ..border.arrays import floats, integers, row_matrix
from ..border.damage import names_damage
from ..border.placement import Placement
from ..border.stage_files import LAYERS, OTHERS, check_not_input, open_stage, write_stage
from ..border.units import Border
from ..shot.curves import find_curves, read_groom
from ..shot.notes import few
from .beside import Beside, Primvar, read_beside
from .prims import POLYLINES, Spline, author_curves

USD = (*LAYERS, ".usdz")
BELOW = 0.02
"""The middle of a head is at least this far below the lowest root [m]."""


@dataclass(frozen=True)
class Authored:
    """A groom, with further attributes of the curves that it was read from.

    Attributes:
        groom: the strands.
        spline: how a renderer interpolates them.
        beside: what else the curves have.
    """

    groom: Groom
    spline: Spline = POLYLINES
    beside: Beside = Beside()


def import_groom(source, out, unit: str | float | None = None, up: str | None = None) -> tuple[list[Groom], list[str]]:
    """Read a hair file (TressFX, .hair, .data, .bin, USD curves) and write it as a USD groom in metres, Y up.

    Args:
        source: the hair file.
        out: USD file to write.
        unit: "mm", "cm", "in", "m" or metres per unit of the source; if left out, what the file says, or what suits a head.
        up: "Y" or "Z", the source's upward axis.

    Returns:
        The grooms, and what a user should know.

    Raises:
        NeuralocksError: the source cannot be read or the target cannot be written.
    """
    source, out = as_path(source, "source"), as_path(out, "out")
    if source.suffix.lower() in (*USD, *OTHERS):
        found, notes = _read_usd(source, out, unit, up)
    else:
        from neuralocks_core import formats

        groom, look, notes = formats.read_with_look(source, unit, up)
        found = [Authored(groom, beside=Beside(_primvars(look)))]
    write_grooms(out, found)
    return [each.groom for each in found], notes


def write_groom(path, groom: Groom, border: Border | None = None) -> Path:
    """Write one groom; see `write_grooms`."""
    return write_grooms(path, [Authored(groom)], border)


def write_grooms(path, grooms: list[Authored], border: Border | None = None) -> Path:
    """Write grooms below one root prim `/Groom`; the file is complete once it has its final name.

    Args:
        path: USD file to write.
        grooms: in metres, Y up.
        border: of the stage that the grooms are made for, whose unit and axis the file uses; metres and Y up if left out.

    Raises:
        NeuralocksError: the path has another extension or cannot be written.
    """

    def author(stage: Usd.Stage) -> None:
        UsdGeom.SetStageUpAxis(stage, border.up_axis if border else UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, border.metres_per_unit if border else 1.0)
        root = UsdGeom.Xform.Define(stage, "/Groom")
        if border and not np.array_equal(border.from_core, np.eye(4)):
            root.AddTransformOp().Set(row_matrix(border.from_core))
        Usd.ModelAPI(root).SetKind("component")
        stage.SetDefaultPrim(root.GetPrim())
        for each in grooms:
            each.beside.author(author_groom(stage, _free_path(stage, each.groom.name), each.groom, each.spline))

    return write_stage(as_path(path, "path"), author)


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


def _primvars(look: Look) -> tuple[Primvar, ...]:
    """Colours as primvars that renderers and viewports know."""
    names, found = Sdf.ValueTypeNames, []
    for name, kind, values, array in (
        ("displayColor", names.Color3fArray, look.color, Vt.Vec3fArray),
        ("displayOpacity", names.FloatArray, look.opacity, Vt.FloatArray),
    ):
        if values is not None:
            scope = UsdGeom.Tokens.constant if len(values) == 1 else UsdGeom.Tokens.vertex
            found.append(Primvar(name, kind, scope, 1, array.FromNumpy(np.ascontiguousarray(values))))
    return tuple(found)


@names_damage
def _read_usd(source: Path, out: Path, unit, up) -> tuple[list[Authored], list[str]]:
    stage = open_stage(source)
    check_not_input(out, stage)
    border = Border.of(stage)
    metres = border.metres_per_unit if unit is None else metres_per_unit(unit)
    border = Border(metres, border.up_axis if up is None else upward_axis(up), border.rate, border.frame)
    found, notes, left = [], [], []
    for prim in find_curves(stage):
        curves = UsdGeom.BasisCurves(prim)
        groom = read_groom(prim, border.to_core @ Placement(prim).reference, notes)
        tokens = [str(a.Get()) for a in (curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr())]
        found.append(Authored(groom, Spline(*tokens), read_beside(prim, groom, left)))
    if not found:
        raise NeuralocksError(f"{source}: holds no BasisCurves; give a file with hair curves")
    return found, notes + few(left, "primvars and materials are not imported like that")


def _free_path(stage: Usd.Stage, name: str) -> str:
    """An unused prim path below /Groom for a groom's name, which may be a file or a prim path."""
    base = Tf.MakeValidIdentifier(Path(name.rsplit("/", 1)[-1]).stem or "Hair")
    path, number = f"/Groom/{base}", 1
    while stage.GetPrimAtPath(path):
        number += 1
        path = f"/Groom/{base}_{number}"
    return path
