# SPDX-License-Identifier: Apache-2.0
"""Hair curves of a USD file, as they are imported."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pxr import Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats.units import metres_per_unit, upward_axis
from neuralocks_core.rotation import angle_between, polar

from ..border.damage import names_damage
from ..border.placement import Placement
from ..border.stage_files import check_not_input, open_stage
from ..border.stopping import check
from ..border.told_once import few
from ..border.units import Border
from ..shot.carriers.attach import Attachment
from ..shot.carriers.twin_bodies import one_person
from ..shot.characters.skeletons import read_each_rig
from ..shot.notes.groom_notes import groom_notes, no_points
from ..shot.notes.missing import no_groom
from ..shot.notes.stage_notes import composition_notes, unit_notes
from ..shot.search.hair_search import HairSearch
from ..shot.search.other_curves import of_other_kinds
from ..shot.search.rig_controls import open_curves
from ..shot.strands.curve_ends import beyond_ends
from ..shot.strands.curves import find_curves, read_groom, widths_attribute, without_points
from ..skel.bind_world import bind_shown
from ..skel.binding import bound_skeleton, geom_bind
from ..skel.joints import JointSource
from ..skel.source import find_skeletons
from .curve_primvars import read_beside
from .groom import Authored
from .prims import Spline

ASKEW = 1.0
"""Hair that is turned by less than this [degrees] counts as facing forward."""


@names_damage
def read_usd(source: Path, out: Path, unit, up, grooms, sized: bool, onto: bool) -> tuple[list[Authored], list[str]]:
    """The curves of a USD file that are hair, where the stage shows them at rest, and what a user should know.

    Args:
        source, out, unit, up, grooms: as for `importing.import_groom`.
        sized: a head sizes them.
        onto: they are put on a head: if the file has the character that carries them, they are as in its bind pose and face forward;
            the hair of other characters, and what no head carries, is left out.

    Raises:
        NeuralocksError: the file cannot be read, or has no hair.
    """
    stage = open_stage(source)
    check_not_input(out, stage)
    own = Border.of(stage)
    metres = own.metres_per_unit if unit is None else metres_per_unit(unit)
    border = Border(metres, own.up_axis if up is None else upward_axis(up), own.rate, own.frame)
    found, notes, left = [], composition_notes(stage, source), []
    notes += [] if sized or unit is not None else unit_notes(stage, source)
    every = find_curves(stage, grooms)
    hair = open_curves(every)
    kept, empty = {*hair}, without_points(hair)  # a set: some exporters write a prim for each of thousands of strands
    closed = [prim for prim in every if prim not in kept]
    notes += few(
        [
            f"{prim.GetPath()}: its curves are closed, as a rig's controls are; left out: set their wrap to pinned if they are hair"
            for prim in closed
        ]
    )
    notes += few([no_points(str(prim.GetPath())) for prim in empty]) + few(of_other_kinds(stage))
    filled = [prim for prim in hair if prim not in empty]
    carried, uncarried = _carried(stage, filled, named=bool(grooms))
    if onto and carried and border.up_axis == own.up_axis:
        placed, told = _facing_forward(carried, metres / own.metres_per_unit)
        notes += uncarried + told
    else:
        placed = [(prim, border.to_core @ place) for prim, place in zip(filled, _places(filled), strict=True)]
    for prim, place in placed:
        curves = UsdGeom.BasisCurves(prim)
        groom = read_groom(prim, place, notes)
        notes += [] if sized else groom_notes(prim, groom, border)
        if widths_attribute(curves).ValueMightBeTimeVarying():
            notes.append(f"{prim.GetPath()}: its widths change over time; the first ones are imported")
        tokens = [str(a.Get()) for a in (curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr())]
        found.append(Authored(groom, Spline(*tokens), read_beside(prim, groom, left), beyond_ends(prim)))
        notes += carried[prim].turned if prim in carried else []
    if not found:
        raise no_groom(stage, source, "give a file with hair curves")
    return found, notes + few(left, "primvars and materials are not imported like that")


def _places(curves: list[Usd.Prim]) -> Iterator[np.ndarray]:
    """Where the stage shows curves at rest, each (4, 4): of those bound to a skeleton, skinning ignores the prim's own transform."""
    known: dict[str, np.ndarray] = {}  # hundreds of prims may be bound to one
    for prim in curves:
        path = bound_skeleton(prim)
        if path is None:
            yield Placement(prim).reference
            continue
        if path not in known:
            skeleton = prim.GetStage().GetPrimAtPath(path)
            try:
                known[path] = bind_shown(JointSource(skeleton))
            except NeuralocksError:  # whatever is wrong with it, its curves are imported
                known[path] = Placement(skeleton).reference
        yield known[path] @ geom_bind(prim)


def _facing_forward(
    carried: dict[Usd.Prim, Attachment], scale: float
) -> tuple[list[tuple[Usd.Prim, np.ndarray]], list[str]]:
    """The curves of the first character, each with its way (4, 4) to that one's bind pose, turned to face +Z and scaled; and notes on how
    its head faces where the hair is shown, and on the hair of other characters.
    """
    first = next((each for each in carried.values() if not each.off_head), next(iter(carried.values()))).rig
    turn, found, others = np.eye(4), [], []
    turn[:3, :3] = scale * first.character.facing
    for prim, each in carried.items():
        if each.rig is first or one_person(first, each.rig):
            found.append((prim, turn @ each.to_bind))
        else:
            others.append(
                f"{prim.GetPath()}: is hair of {each.rig.path}, not of {first.path}, so it is left out; name it with --groom"
            )
    prim, way = found[0]
    shown = polar((first.border.to_core @ next(_places([prim])))[:3, :3])[0]
    angle = float(np.degrees(angle_between(polar(way[:3, :3])[0], shown)))
    told = f"{first.path}: where its hair is, its head faces {angle:.0f} degrees off forward; the hair was turned to face forward"
    return found, [told] * (angle > ASKEW) + few(others, "grooms are not its hair")


def _carried(stage: Usd.Stage, curves: list[Usd.Prim], named: bool) -> tuple[dict[Usd.Prim, Attachment], list[str]]:
    """What carries the curves, as far as the file has their characters, and notes on those that nothing carries."""
    try:
        rigs, _ = read_each_rig(stage, find_skeletons(stage), Border.of(stage))
    except NeuralocksError:  # whatever is wrong with its characters, its curves are imported
        check()
        return {}, []
    if not rigs:
        return {}, []
    found, notes, search = {}, [], HairSearch(rigs, None, [], named=named)
    for prim in search.filled(curves):
        try:
            own = search.attachment(prim, Placement(prim))
            found |= {} if own is None else {prim: own}
        except NeuralocksError as error:
            check()
            notes.append(str(error))
    return found, search.no_hair() + few(notes)
