# SPDX-License-Identifier: Apache-2.0
"""A shot: any stage with animated skeletons and BasisCurves grooms, read into core types."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from pxr import Usd, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom

from .attach import Attachment, attach, of_another, rig_joint
from .border import Border, open_stage
from .curves import find_curves, read_groom, without_points
from .damage import names_damage
from .notes import (
    another_carries,
    composition_notes,
    few,
    groom_notes,
    left_out,
    no_points,
    nothing_found,
    rig_notes,
    stands_still,
    too_far,
)
from .placement import Placement
from .rig_source import StageRig, read_rig


@dataclass(frozen=True)
class StageGroom:
    """One groom of a shot.

    Attributes:
        path: the BasisCurves prim.
        prim: the same, of the opened stage.
        groom: at rest, bind-world metres.
        attachment: what carries it, and where it lies in the bind pose.
        placement: where the prim stands.
    """

    path: str
    prim: Usd.Prim = field(repr=False)
    groom: Groom = field(repr=False)
    attachment: Attachment = field(repr=False)
    placement: Placement = field(repr=False)

    @property
    def joint(self) -> str:
        """Path of the joint that carries it."""
        return rig_joint(self.attachment)


@dataclass(frozen=True)
class Shot:
    """A stage read for a bake.

    Attributes:
        path: the file.
        stage: kept open: poses are sampled from it at the exact time codes of a bake.
        border: its units.
        rigs: skeletons, those that carry a groom at least.
        grooms: what is to be deformed.
        first, last: frame range in time codes.
        notes: what a user should know, one line each.
    """

    path: Path
    stage: Usd.Stage = field(repr=False)
    border: Border
    rigs: tuple[StageRig, ...]
    grooms: tuple[StageGroom, ...]
    first: float
    last: float
    notes: tuple[str, ...]


@names_damage
def read_shot(path, grooms=None, skeleton: str | None = None, head: str | None = None, joints=None) -> Shot:
    """Read a shot for a bake.

    Args:
        path: a USD file.
        grooms: prim paths of the grooms wanted; if left out, all curves that lie on a skin or near a head.
        skeleton: prim path of the skeleton that carries them; found if left out.
        head: joint (path, or its last part) that carries grooms for which no binding says so.
        joints: semantic joint -> joint (path, or its last part), where names do not tell.

    Raises:
        NeuralocksError: what stops a bake, with the prim and the remedy.
    """
    path = Path(path)
    stage = open_stage(path)
    border = Border.of(stage)
    notes = composition_notes(stage, path)
    curves = find_curves(stage, grooms)
    if not curves:
        raise nothing_found(
            stage, path, "groom (no BasisCurves prim)", "add one, or import a hair file with 'neuralocks import'"
        )
    rigs = _rigs(stage, border, skeleton, head, path, joints=joints)
    _check_animated(rigs, path)
    # Of grooms that are not named, a skeleton that is gets its own.
    named = skeleton is None or grooms
    every = [] if named else _rigs(stage, border, None, head, path, joints=joints)
    others = [rig for rig in every if rig.path != skeleton]
    found, far = [], []
    empty = [] if grooms else without_points(curves)
    notes += few([no_points(str(prim.GetPath())) for prim in empty])
    for prim in (prim for prim in curves if prim not in empty):
        placement = Placement(prim)
        if others and (other := of_another(prim, rigs, others, placement, head)):
            notes.append(another_carries(str(prim.GetPath()), other))
            continue
        attachment = attach(prim, rigs, placement, head, notes)
        if attachment.far and not grooms:
            far.append(too_far(str(prim.GetPath()), attachment))
            continue
        groom = read_groom(prim, attachment.to_bind, notes)
        found.append(StageGroom(str(prim.GetPath()), prim, groom, attachment, placement))
        notes += groom_notes(found[-1].path, groom)
    if not found:
        raise NeuralocksError(
            far[0] if far else f"{skeleton}: carries no groom; choose another skeleton, or name the groom"
        )
    notes += few(far)
    still = [item for item in found if not item.attachment.rig.source.animated]
    if still and len(still) < len(found) and not grooms:
        found = [item for item in found if item.attachment.rig.source.animated]
        notes += [stands_still(item.path, item.attachment.rig) for item in still]
    carrying = {id(g.attachment.rig) for g in found}
    used = tuple(rig for rig in rigs if id(rig) in carrying)
    for rig in used:
        _check_animated([rig], path)
        notes += rig.notes + rig_notes(rig)
    first, last = frame_range(stage, used)
    return Shot(
        path=path,
        stage=stage,
        border=border,
        rigs=used,
        grooms=tuple(found),
        first=first,
        last=last,
        notes=tuple(dict.fromkeys(notes)),
    )


@names_damage
def read_rigs(
    path, skeleton: str | None = None, head: str | None = None, *, all_shapes: bool = True
) -> tuple[StageRig, ...]:
    """The characters and motion of a file, without grooms and whether animated or not.

    Args:
        path: a USD file.
        skeleton: prim path of the one wanted; all if left out.
        head: joint that is the head, where its name does not tell.
        all_shapes: keep blend shapes that no animation uses.
    """
    stage = open_stage(path)
    return tuple(_rigs(stage, Border.of(stage), skeleton, head, Path(path), all_shapes=all_shapes))


def frame_range(stage: Usd.Stage, rigs) -> tuple[float, float]:
    """First and last time code: the stage's own, else the animation's."""
    if stage.HasAuthoredTimeCodeRange():
        first, last = float(stage.GetStartTimeCode()), float(stage.GetEndTimeCode())
        if np.isfinite([first, last]).all() and first <= last:
            return first, last
    return float(min(r.time_codes[0] for r in rigs)), float(max(r.time_codes[-1] for r in rigs))


def find_skeletons(stage: Usd.Stage) -> list[Usd.Prim]:
    """Skeleton prims in stage order."""
    every = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies())
    return [prim for prim in every if prim.IsA(UsdSkel.Skeleton)]


def _rigs(stage, border, skeleton, head, path, *, all_shapes=False, joints=None) -> list[StageRig]:
    prims = find_skeletons(stage)
    names = ", ".join(str(p.GetPath()) for p in prims[:5]) or "none"
    if skeleton is not None:
        prims = [p for p in prims if str(p.GetPath()) == skeleton]
        if not prims:
            raise NeuralocksError(f"{skeleton}: no such skeleton; the stage's skeletons are: {names}")
    if not prims:
        raise nothing_found(stage, path, "UsdSkel skeleton", "export the character with its armature")
    rigs, errors = [], []
    for prim in prims:
        try:
            rigs.append(read_rig(stage, prim, border, head, all_shapes=all_shapes, joints=joints))
        except NeuralocksError as error:
            errors.append(error)
    if errors and (not rigs or skeleton):
        raise errors[0]
    for error in errors:
        rigs[0].notes.append(left_out(error))
    return rigs


def _check_animated(rigs: list[StageRig], path: Path) -> None:
    if not any(rig.source.animated for rig in rigs):
        raise NeuralocksError(
            f"{rigs[0].path}: the skeleton has no animation{_why(rigs[0])}; "
            "bind a SkelAnimation to it (skel:animationSource)"
        )


def _why(rig: StageRig) -> str:
    return (
        f" ({rig.source.notes[-1].split(': ', 1)[1].split(';')[0]})"
        if rig.source.notes and not rig.source.animated
        else ""
    )
