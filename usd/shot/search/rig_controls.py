# SPDX-License-Identifier: Apache-2.0
"""Curves that are a rig's controls, exported with it, and not hair."""

from collections.abc import Sequence

from pxr import Usd, UsdGeom

from ...border.placement import Placement
from ...skel.binding import bound_skeleton
from ...skel.stage_rig import StageRig
from ..carriers.seat import NEAR, find_seat
from ..strands.curves import rest_counts


def is_closed(prim: Usd.Prim) -> bool:
    """Whether curves are closed, as no hair is."""
    return UsdGeom.BasisCurves(prim).GetWrapAttr().Get() == UsdGeom.Tokens.periodic


def open_curves(prims: list[Usd.Prim]) -> list[Usd.Prim]:
    """Those of some curves that are not closed; all of them if all are."""
    return [prim for prim in prims if not is_closed(prim)] or prims


def is_lone_guide(prim: Usd.Prim, rigs: Sequence[StageRig], placement: Placement) -> bool:
    """Whether a prim is one unbound curve of purpose guide that does not begin on skin. One that does may be a groom's guide: some
    tools make a prim for each.
    """
    if UsdGeom.Imageable(prim).ComputePurpose() != UsdGeom.Tokens.guide or len(rest_counts(prim)) != 1:
        return False
    bound = bound_skeleton(prim)
    return all(rig.path != bound and find_seat(prim, rig, placement, NEAR) is None for rig in rigs)


def controls_left_out(paths: list[str]) -> list[str]:
    """The line on curves that are taken for controls."""
    if not paths:
        return []
    others = f" and {len(paths) - 1} more prims" if paths[1:] else ""
    return [
        f"{paths[0]}{others}: closed curves, and a single one of purpose guide on no skin, are taken for a rig's controls, not "
        "for hair; if it is hair, name it with --groom"
    ]


def moved_as_open(prim: Usd.Prim) -> list[str]:
    """The note on closed curves that the user named."""
    if not is_closed(prim):
        return []
    return [
        f"{prim.GetPath()}: its curves are closed (wrap periodic) and are moved as hair that begins at the first point of each; "
        "set the wrap to pinned if they are hair"
    ]
