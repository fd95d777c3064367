# SPDX-License-Identifier: Apache-2.0
"""What a stage's grooms are, how they were baked, and what is wrong with them."""

from functools import cache
from pathlib import Path

import numpy as np
from pxr import UsdGeom

from neuralocks_core.deformation.model_choice import suited
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.materials import Material
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.strands.arclength import arc_lengths, count_pointlike

from ..baking.bake import RECORDED, digest_of
from ..baking.model_notes import model_notes
from ..border.placement import Placement
from ..border.units import Border
from ..border.values import as_numbers
from ..shot.bakes.bake_record import recorded, retimed
from ..shot.bakes.gaps import gaps
from ..shot.characters.whole_body import WholeBodies
from ..shot.made_from import baked_from_others
from ..shot.notes.groom_notes import groom_notes
from ..shot.search.hair_search import HairSearch
from ..shot.strands.curve_ends import groom_between, undrawn
from ..shot.strands.curves import rest_counts


def facts_of_grooms(
    search: HairSearch, curves, bodies: WholeBodies, border: Border, spoils: list[str], stops: list[str]
) -> list[dict]:
    """Facts about the curves that are hair; a problem with one of them does not hide the others."""
    grooms = []
    for prim in search.filled(curves):
        try:
            groom = _groom(prim, search if search.rigs else None, bodies, border, spoils, stops)
            grooms += [groom] if groom else []
        except NeuralocksError as error:
            stops.append(str(error))
    (spoils if grooms else stops).extend(search.no_hair() if curves else [])
    return grooms


def groom_facts(groom: Groom) -> dict:
    """Counts and lengths of a groom's strands [m], as plain values."""
    _, lengths = arc_lengths(groom)
    return {
        "name": groom.name,
        "strands": groom.strand_count,
        "vertices": len(groom.points),
        "vertices per strand": sorted({int(groom.counts.min()), int(groom.counts.max())}),
        "strand length [m]": {
            "shortest": round(float(lengths.min()), 4),
            "median": round(float(np.median(lengths)), 4),
            "longest": round(float(lengths.max()), 4),
        },
        "without two distinct points": count_pointlike(groom),
    }


def _groom(
    prim, search: HairSearch | None, bodies: WholeBodies, border: Border, spoils: list[str], stops: list[str]
) -> dict | None:
    """Facts about one groom; `search` is None if there is no skeleton; returns None if the curves are not hair."""
    placement = Placement(prim)
    curves = UsdGeom.BasisCurves(prim)
    facts = {"path": str(prim.GetPath()), "type": str(curves.GetTypeAttr().Get())}
    if facts["type"] == UsdGeom.Tokens.cubic:
        facts |= {"basis": str(curves.GetBasisAttr().Get()), "wrap": str(curves.GetWrapAttr().Get())}
    found, to_bind, drawn, joint = None, None, False, {}
    if search is not None:
        try:
            found = search.attachment(prim, placement)
            if found is None:
                return None
            to_bind, drawn = found.to_bind, found.drawn
            joint = {"skeleton": found.rig.path, "joint": found.joint, "carried by": found.how}
        except NeuralocksError as error:
            stops.append(str(error))
    else:
        spoils += undrawn(prim)
    if to_bind is None:
        to_bind = border.to_core @ placement.reference
        # Without a character, only counts and lengths are reported, and the position changes neither.
        to_bind[:3, 3] = 0
    groom, beyond = groom_between(prim, to_bind, spoils, drawn=drawn)
    if beyond is not None:
        facts["points beyond the ends, not drawn"] = int((~beyond.hair).sum())
    made = recorded(prim)
    if joint:
        whole = bodies.on(found)
        mover = suited(None, whole.character, groom)
        joint["shipped model"] = mover.stem
        spoils += groom_notes(prim, groom, border)
        if not made or made.get("model") == digest_of(_loaded(mover))[:RECORDED]:
            spoils += model_notes(_loaded(mover), Material(), [whole])
    if found:
        spoils += baked_from_others(prim, found, groom)
    baked = {"samples": _samples(prim, border), "baked with": made} if made else {}
    spoils += retimed(prim) + _unfit(prim) if made else []
    return facts | joint | groom_facts(groom) | baked


@cache
def _loaded(path: Path) -> StrandModel:
    return StrandModel.load(path)


def _samples(prim, border: Border) -> dict:
    """Which frames a bake holds."""
    codes = UsdGeom.BasisCurves(prim).GetPointsAttr().GetTimeSamples()
    if not codes:
        return {"number": 0}
    missing = gaps(codes, border.frame, prim.GetStage())
    return {"first": codes[0], "last": codes[-1], "number": len(codes), "missing": missing}


def _unfit(prim) -> list[str]:
    """The note on a bake that does not fit the layers above or below it."""
    curves, count = UsdGeom.BasisCurves(prim), int(rest_counts(prim).sum())
    codes = curves.GetPointsAttr().GetTimeSamples()
    if not codes:
        return [f"{prim.GetPath()}: its samples are hidden by a stronger layer; bake again"]
    code = codes[len(codes) // 2]
    for attribute, kind in ((curves.GetPointsAttr(), "point3f[]"), (curves.GetVelocitiesAttr(), "vector3f[]")):
        try:
            values = as_numbers(attribute, kind, attribute.Get(code), np.float32)
        except NeuralocksError as error:
            return [str(error)]
        if len(values) not in (0, count):
            fact = f"{len(values)} {attribute.GetName()} at time code {code:g} for curves of {count} points"
            return [f"{prim.GetPath()}: {fact}; bake again"]
    return []
