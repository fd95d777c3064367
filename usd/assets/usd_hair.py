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
from ..border.units import Border
from ..shot.attach import Attachment, off_head
from ..shot.curve_ends import beyond_ends
from ..shot.curves import find_curves, read_groom, widths_attribute, without_points
from ..shot.groom_notes import groom_notes, no_points
from ..shot.hair_search import HairSearch
from ..shot.lacking import no_groom
from ..shot.notes import composition_notes, few, unit_notes
from ..shot.other_curves import of_other_kinds
from ..shot.rig_controls import open_curves
from ..shot.skeletons import read_each_rig
from ..skel.bind_world import bind_shown
from ..skel.binding import bound_skeleton, geom_bind
from ..skel.joints import JointSource
from ..skel.source import find_skeletons
from .beside import read_beside
from .groom import Authored
from .prims import Spline

ASKEW = 1.0
"""Hair that is turned by less than this [degrees] counts as facing forward."""


@names_damage
def read_usd(source: Path, out: Path, unit, up, sized: bool, onto: bool) -> tuple[list[Authored], list[str]]:
    """The curves of a USD file that are hair, where the stage shows them at rest, and what a user should know.

    Args:
        source, out, unit, up: as for `importing.import_groom`.
        sized: a head sizes them.
        onto: they are put on a head: if the file says which way their own one faces, they are turned to face forward.

    Raises:
        NeuralocksError: the file cannot be read, or has no hair.
    """
    stage = open_stage(source)
    check_not_input(out, stage)
    border = Border.of(stage)
    metres = border.metres_per_unit if unit is None else metres_per_unit(unit)
    border = Border(metres, border.up_axis if up is None else upward_axis(up), border.rate, border.frame)
    found, notes, left = [], composition_notes(stage, source), []
    notes += [] if sized or unit is not None else unit_notes(stage, source)
    every = find_curves(stage)
    hair = open_curves(every)
    closed, empty = [prim for prim in every if prim not in hair], without_points(hair)
    notes += few(
        [
            f"{prim.GetPath()}: its curves are closed, as a rig's controls are; left out: set their wrap to pinned if they are hair"
            for prim in closed
        ]
    )
    notes += few([no_points(str(prim.GetPath())) for prim in empty]) + few(of_other_kinds(stage))
    filled, carried = [prim for prim in hair if prim not in empty], _carried(stage, every)
    for prim, place in zip(filled, _places(filled), strict=True):
        curves, place, own = UsdGeom.BasisCurves(prim), border.to_core @ place, carried.get(prim)
        if own is not None and onto and up is None:
            place, turned = _facing_forward(place, own)
            notes += turned
        groom = read_groom(prim, place, notes)
        notes += [] if sized else groom_notes(prim, groom, border)
        if widths_attribute(curves).ValueMightBeTimeVarying():
            notes.append(f"{prim.GetPath()}: its widths change over time; the first ones are imported")
        tokens = [str(a.Get()) for a in (curves.GetTypeAttr(), curves.GetBasisAttr(), curves.GetWrapAttr())]
        found.append(Authored(groom, Spline(*tokens), read_beside(prim, groom, left), beyond_ends(prim)))
    if not found:
        raise no_groom(stage, source, "give a file with hair curves")
    notes += [note for own in carried.values() for note in own.turned]
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


def _facing_forward(place: np.ndarray, own: Attachment) -> tuple[np.ndarray, list[str]]:
    """The place (4, 4) of curves, turned so that the head that carries them faces +Z, and the note on that; as it is, if it does."""
    if off_head(own):
        return place, []
    forward = polar(own.character.facing @ own.to_bind[:3, :3])[0] @ polar(place[:3, :3])[0].T
    angle = float(np.degrees(angle_between(forward, np.eye(3))))
    if not angle > ASKEW:
        return place, []
    turn = np.eye(4)
    turn[:3, :3] = forward
    return turn @ place, [
        f"{own.rig.path}: where its hair is, its head faces {angle:.0f} degrees off forward; the hair was turned to face forward"
    ]


def _carried(stage: Usd.Stage, curves: list[Usd.Prim]) -> dict[Usd.Prim, Attachment]:
    """What carries the curves, as far as the file has their characters."""
    try:
        rigs, _ = read_each_rig(stage, find_skeletons(stage), Border.of(stage))
        if not rigs:
            return {}
        search = HairSearch(rigs, None, [])
        found = {prim: search.attachment(prim, Placement(prim)) for prim in search.filled(curves)}
    except NeuralocksError:  # whatever is wrong with its characters, its curves are imported
        check()
        return {}
    return {prim: own for prim, own in found.items() if own is not None}
