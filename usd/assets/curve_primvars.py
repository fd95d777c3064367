# SPDX-License-Identifier: Apache-2.0
"""What imported curves have besides their strands: primvars, purpose and visibility, their own or of the prims above."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdShade

from neuralocks_core import rest_copy
from neuralocks_core.groom import Groom

from ..skel.binding import rest_primvar
from ..skel.surface import ever_visible

KNOWN = ("st", "displayColor", "displayOpacity")
"""Primvars that are kept whatever their type, besides all whose names begin with `groom_`."""
OWN = ("groom_version_major", "groom_version_minor", "groom_tool")
"""Primvars that say what wrote the file."""
READ = ("widths", rest_copy.NAME)
"""Primvars that are read into the groom."""
WIDTH = "groom_width"
"""Widths once more [cm], which every import writes from those of the groom: an old one would keep the size that the hair had
before a unit or a head changed it."""
ELSEWHERE = ("primvars:", "xformOp:", "skel:", "userProperties:", "neuralocks:")
"""How the names of attributes begin that are read elsewhere, or that say something of a file rather than of its hair."""
OF_A_SPACE = (Sdf.ValueRoleNames.Point, Sdf.ValueRoleNames.Vector, Sdf.ValueRoleNames.Normal, Sdf.ValueRoleNames.Frame)
"""Roles of values that belong to the space which the curves come from."""


class Primvar(NamedTuple):
    """The arguments of `UsdGeomPrimvarsAPI.CreatePrimvar`, and the value."""

    name: str
    kind: Sdf.ValueTypeName
    interpolation: str
    size: int
    value: object


@dataclass(frozen=True)
class Beside:
    """What curves have besides the groom's strands.

    Attributes:
        primvars: what other tools put on the curves.
        purpose: the token of UsdGeomImageable.
        visible: whether they are ever shown.
    """

    primvars: tuple[Primvar, ...] = ()
    purpose: str = "default"
    visible: bool = True

    def author(self, curves: UsdGeom.BasisCurves) -> None:
        """Write it to curves."""
        for *arguments, value in self.primvars:
            # The groom's own, of another type, may be there already, and keeps its type.
            curves.GetPrim().RemoveProperty(f"primvars:{arguments[0]}")
            UsdGeom.PrimvarsAPI(curves).CreatePrimvar(*arguments).Set(value)
        if self.purpose != UsdGeom.Tokens.default_:
            curves.CreatePurposeAttr(self.purpose)
        if not self.visible:
            curves.CreateVisibilityAttr(UsdGeom.Tokens.invisible)


def read_beside(prim: Usd.Prim, groom: Groom, notes: list[str]) -> Beside:
    """Read what an import keeps, with notes on what it drops.

    Args:
        prim: the curves.
        groom: the curves as read.
        notes: what a user should know is added here.
    """
    primvars = _read_primvars(prim, groom, notes)
    others = [each.GetName() for each in prim.GetAuthoredAttributes() if each.IsCustom()]
    if others := [name for name in others if not name.startswith(ELSEWHERE)]:
        notes.append(f"{prim.GetPath()}: {', '.join(others)} left out; only primvars are imported, make them primvars")
    if UsdGeom.BasisCurves(prim).GetNormalsAttr().HasAuthoredValue():
        notes.append(
            f"{prim.GetPath()}: its normals, which make ribbons, are not imported; author them on the new groom"
        )
    if subsets := UsdGeom.Subset.GetAllGeomSubsets(UsdGeom.Imageable(prim)):
        notes.append(
            f"{prim.GetPath()}: its {len(subsets)} subsets, such as {subsets[0].GetPrim().GetName()}, are not imported, nor their "
            "materials; bind these to the new groom"
        )
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    if material:
        notes.append(f"{prim.GetPath()}: its material {material.GetPath()} is not imported; bind one to the new groom")
    return Beside(primvars, str(UsdGeom.Imageable(prim).ComputePurpose()), ever_visible(prim))


def _read_primvars(prim: Usd.Prim, groom: Groom, notes: list[str]) -> tuple[Primvar, ...]:
    found, path = [], prim.GetPath()
    varying = _varying_sizes(UsdGeom.BasisCurves(prim), len(groom.points))
    # The schema of curves takes "faceVarying" for another word for "varying".
    sizes = {"uniform": {groom.strand_count}, "vertex": {len(groom.points)}, "varying": varying, "faceVarying": varying}
    api = UsdGeom.PrimvarsAPI(prim)
    sized = UsdGeom.BasisCurves(prim).GetWidthsAttr().HasAuthoredValue() or api.HasPrimvar("widths")
    written = OWN + READ + ((WIDTH,) if sized else ())
    for primvar in api.FindPrimvarsWithInheritance():
        name, scope, each = str(primvar.GetPrimvarName()), str(primvar.GetInterpolation()), primvar.GetElementSize()
        if not primvar.HasAuthoredValue() or name in written or name.startswith("skel:"):
            continue
        value = rest_primvar(primvar)
        fits = np.shape(value)[:1] in [(many * each,) for many in sizes.get(scope, ())]
        if value is None or scope != "constant" and not fits:
            notes.append(
                f"{path}: primvars:{name} ({scope}) does not fit {groom.strand_count} strands of "
                f"{len(groom.points)} points; left out"
            )
        elif why := "" if name.startswith("groom_") or name in KNOWN else _stays(primvar.GetTypeName()):
            notes.append(f"{path}: primvars:{name} {why}; left out")
        else:
            if primvar.ValueMightBeTimeVarying():
                notes.append(f"{path}: primvars:{name} changes over time; its first values are imported")
            found.append(Primvar(name, primvar.GetTypeName(), scope, each, value))
    return tuple(found)


def _stays(kind: Sdf.ValueTypeName) -> str:
    """Why values of a type are not copied to a file with other units and axes; '' if they are."""
    if kind.scalarType == Sdf.ValueTypeNames.Asset:
        return "names files, whose paths may not resolve from elsewhere"
    if kind.role in OF_A_SPACE or str(kind.scalarType).startswith(("matrix", "frame")):
        return f"({kind}) is in the space of its own file"
    return ""


def _varying_sizes(curves: UsdGeom.BasisCurves, points: int) -> set[int]:
    """How many varying values curves with this many points in all may have: one for each end of a segment."""
    known, basis = (UsdGeom.Tokens.bezier, UsdGeom.Tokens.bspline, UsdGeom.Tokens.catmullRom), curves.GetBasisAttr()
    time = Usd.TimeCode.EarliestTime()
    # A relationship of that name has no type.
    is_token = all(getattr(each, "typeName", "") == "token" for each in basis.GetPropertyStack())
    if curves.GetTypeAttr().Get(time) == UsdGeom.Tokens.cubic and not (is_token and basis.Get(time) in known):
        return {points}  # as of lines; USD would divide by zero
    sizes = {curves.ComputeVaryingDataSize(time)}
    # Pinned curves are drawn through their first and last points, too; not all tools count segments there.
    return sizes | ({points} if curves.GetWrapAttr().Get() == UsdGeom.Tokens.pinned else set())
