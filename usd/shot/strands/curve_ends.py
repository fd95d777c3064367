# SPDX-License-Identifier: Apache-2.0
"""Where drawn curves begin and end: some have a point beyond each end, which only steers the curve.

A Catmull-Rom curve that is not pinned goes from its second point to the last but one, and a B-spline begins and ends
nearly there (UsdGeomBasisCurves, "Cubic Basis and Wrap"). If the outer points are repeated, the curve ends at them. But not
all curves with the default wrap have such points: `seat.begins_where_drawn` checks against the skin.
"""

from dataclasses import dataclass, replace

import numpy as np
from pxr import Usd, UsdGeom

from neuralocks_core.groom import Groom

from .curves import read_groom, rest_counts, rest_points

LEAST = 4
"""Points of a cubic segment; shorter strands are not drawn, and all their points are taken for hair."""


@dataclass(frozen=True)
class Beyond:
    """Points that lie beyond the ends of the drawn curves.

    Attributes:
        before: those before a curve's first drawn point (n,), ascending; the following two are drawn.
        after: those after a curve's last drawn point (m,), ascending; the two before are drawn.
        hair: which of all points (P,) are drawn.
    """

    before: np.ndarray
    after: np.ndarray
    hair: np.ndarray

    def left_out(self, groom: Groom) -> Groom:
        """A groom with all P points, without the points beyond."""
        counts = groom.counts - np.bincount(groom.strand_of_point[~self.hair], minlength=groom.strand_count)
        each = len(groom.widths) == len(groom.points)
        return replace(
            groom,
            points=groom.points[self.hair],
            counts=counts.astype(np.int32),
            widths=groom.widths[self.hair] if each else groom.widths,
        )


def groom_between(prim: Usd.Prim, to_bind: np.ndarray, notes: list[str], *, drawn: bool) -> tuple[Groom, Beyond | None]:
    """What `read_groom` gives; if hair begins where it is drawn, only the drawn part, and which points it lacks."""
    groom, beyond = read_groom(prim, to_bind, notes), beyond_ends(prim) if drawn else None
    return (groom if beyond is None else beyond.left_out(groom)), beyond


def beyond_ends(prim: Usd.Prim) -> Beyond | None:
    """The points beyond the ends of a BasisCurves; None if there are none, or if its counts do not fit its points."""
    curves, tokens = UsdGeom.BasisCurves(prim), UsdGeom.Tokens
    if curves.GetTypeAttr().Get() != tokens.cubic or curves.GetWrapAttr().Get() != tokens.nonperiodic:
        return None
    if curves.GetBasisAttr().Get() not in (tokens.catmullRom, tokens.bspline):
        return None
    points, counts = rest_points(prim), rest_counts(prim)
    if counts.sum() != len(points) or counts.min(initial=0) < 0:
        return None
    drawn = counts >= LEAST
    last = (np.cumsum(counts) - 1)[drawn]
    first = last + 1 - counts[drawn]
    before = first[(points[first] != points[first + 1]).any(axis=1)]
    after = last[(points[last] != points[last - 1]).any(axis=1)]
    hair = np.ones(len(points), bool)
    hair[before] = hair[after] = False
    return None if hair.all() else Beyond(before, after, hair)


def undrawn(prim: Usd.Prim) -> list[str]:
    """The note on strands of a cubic BasisCurves with incomplete segments (UsdGeomBasisCurves, "Vertex count")."""
    curves, tokens = UsdGeom.BasisCurves(prim), UsdGeom.Tokens
    basis, wrap = curves.GetBasisAttr().Get(), curves.GetWrapAttr().Get()
    if curves.GetTypeAttr().Get() != tokens.cubic or wrap == tokens.periodic:
        return []
    counts = rest_counts(prim)
    if basis == tokens.bezier:
        odd, fitting = (counts < LEAST) | ((counts - LEAST) % 3 != 0), "4, 7, 10 and so on"
    else:
        least = 2 if wrap == tokens.pinned else LEAST
        odd, fitting = counts < least, f"{least} or more"
    odd &= counts > 1  # a lone point gets the note on what does not move
    if not odd.any():
        return []
    found = list(map(str, np.unique(counts[odd])))
    told = ", ".join(found[:3]) + (", ..." if len(found) > 3 else "")
    return [
        f"{prim.GetPath()}: {int(odd.sum())} of {len(counts)} strands have {told} points, where {basis} curves ({wrap}) need "
        f"{fitting}; renderers draw such strands in part or not at all, export them as linear curves"
    ]


def ends(prim: Usd.Prim, *, last: bool = False, beyond: Beyond | None = None) -> np.ndarray:
    """Which points (n,) are strands' first or last ones, not counting those `beyond`; only the very first one if the counts do not
    fit the points.
    """
    points, counts = len(rest_points(prim)), rest_counts(prim)
    found = np.cumsum(counts) - (1 if last else counts)
    found = found[(counts > 0) & (found >= 0) & (found < points)]
    if beyond is not None:
        found = found - np.isin(found, beyond.after) if last else found + np.isin(found, beyond.before)
    return found if len(found) else np.zeros(1, np.int64)
