# SPDX-License-Identifier: Apache-2.0
"""A shot: any stage with animated skeletons and BasisCurves grooms, read into core types."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from pxr import Usd

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path
from neuralocks_core.groom import Groom

from ..border.damage import names_damage
from ..border.placement import Placement
from ..border.prim_paths import prim_path
from ..border.stage_files import open_stage
from ..border.time_codes import NEAR, given_cuts
from ..border.told_once import few
from ..border.units import Border
from ..skel.cut_samples import within
from ..skel.source import find_skeletons
from ..skel.stage_rig import StageRig
from .carriers.attach import Attachment
from .characters.others import Others
from .characters.skeletons import read_each_rig
from .characters.whole_body import WholeBodies, whole_body
from .notes.character_notes import lies_down, untrained, weight_notes, without_body
from .notes.groom_notes import groom_notes, stands_still
from .notes.missing import no_groom, no_skeleton
from .notes.skeleton_notes import left_out, not_animated, partial_body, rig_notes, without_turn
from .notes.stage_notes import composition_notes, layer_notes
from .search.hair_search import HairSearch
from .strands.curve_ends import Beyond, groom_between
from .strands.curves import find_curves


@dataclass(frozen=True)
class StageGroom:
    """One groom of a shot.

    Attributes:
        path: the BasisCurves prim.
        prim: the same, of the opened stage.
        groom: at rest, bind-world metres, as it is drawn.
        attachment: what carries it, and where it lies in the bind pose.
        placement: where the prim stands.
        beyond: points of the prim that are not drawn, and that the groom lacks, if there are any.
    """

    path: str
    prim: Usd.Prim = field(repr=False)
    groom: Groom = field(repr=False)
    attachment: Attachment = field(repr=False)
    placement: Placement = field(repr=False)
    beyond: Beyond | None = field(default=None, repr=False)

    @property
    def point_count(self) -> int:
        """P, how many points the prim has."""
        return len(self.groom.points if self.beyond is None else self.beyond.hair)

    @property
    def joint(self) -> str:
        """Path of the joint that carries it."""
        return self.attachment.joint


@dataclass(frozen=True)
class Shot:
    """A stage read for a bake.

    Attributes:
        path: the file.
        stage: kept open: poses are sampled from it at the exact time codes of a bake.
        border: its units.
        rigs: skeletons, at least those that carry a groom.
        grooms: those to deform.
        first, last: frame range in time codes.
        notes: what a user should know, one line each.
        joints, cuts: as they were given to `read_shot`.
    """

    path: Path
    stage: Usd.Stage = field(repr=False)
    border: Border
    rigs: tuple[StageRig, ...]
    grooms: tuple[StageGroom, ...]
    first: float
    last: float
    notes: tuple[str, ...]
    joints: dict[str, str] | None = None
    cuts: list[float] | dict[str, list[float]] | None = None

    def given_cuts(self, rig: StageRig) -> list[float] | None:
        """The cuts that were given for a skeleton."""
        return self.cuts.get(rig.path) if isinstance(self.cuts, dict) else self.cuts


@names_damage
def read_shot(
    path,
    grooms=None,
    skeleton: str | None = None,
    head: str | None = None,
    joints=None,
    cuts=None,
    still: bool = False,
    as_baked: bool = False,
) -> Shot:
    """Read a shot for a bake.

    Args:
        path: a USD file.
        grooms: prim paths of the grooms wanted; if left out, all curves that lie on a skin or near a head.
        skeleton: prim path of the skeleton that carries them; found if left out.
        head: joint (path, or its last part) that carries the grooms that no binding assigns to a joint.
        joints: semantic joint -> joint (path, or its last part), if names are not enough.
        cuts: time codes at which every character is suddenly elsewhere and its hair starts anew, or a dictionary of them by
            skeleton path; detected if None.
        still: also read the hair of characters without an animation.
        as_baked: hair that was baked is that of the skeleton that carried it then, if that is among those wanted.

    Raises:
        NeuralocksError: what stops a bake, with the prim and the remedy.
    """
    path, skeleton = as_path(path, "shot"), prim_path(skeleton, "skeleton")
    cuts = cuts if isinstance(cuts, dict) else given_cuts(cuts)
    stage = open_stage(path)
    border = Border.of(stage)
    notes = composition_notes(stage, path) + layer_notes(stage, path)
    curves = find_curves(stage, grooms)
    if not curves:
        raise no_groom(stage, path)
    rigs, unusable = _rigs(stage, border, skeleton, head, path, joints=joints, cuts=cuts)
    notes += unusable
    if not still:
        _check_animated(rigs)
    check_cuts(cuts, rigs)
    # A named skeleton gets its own hair only: hair that another one carries is left out, unless it is named too.
    others = None if skeleton is None else Others(rigs, stage, head, joints)
    search = HairSearch(
        rigs,
        head,
        notes,
        named=bool(grooms),
        others=None if grooms else others,
        forced=bool(grooms and skeleton),
        as_baked=as_baked,
    )
    found = _grooms(search, curves, notes)
    no_hair = search.no_hair()
    if not found:
        nothing = f"{skeleton}: carries no groom; choose another skeleton, or name the groom"
        raise NeuralocksError((*no_hair, *search.nobodys(), nothing)[0])
    notes += no_hair + search.off_heads() + search.of_others()
    if not (grooms or still):
        found = _moving(found, notes)
    every = rigs if others is None else [*rigs, *others.maybe_same()]
    used = tuple(rig for rig in rigs if any(item.attachment.rig is rig for item in found))
    bodies = WholeBodies(every)
    for rig in used:
        if not still:
            _check_animated([rig])
        notes += rig.notes + weight_notes(rig) + lies_down(rig) + partial_body(rig, bodies.of(rig)[1])
    found = [replace(item, attachment=bodies.on(item.attachment)) for item in found]
    notes += without_body(used, every) + _notes_on_motion(found)
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
        joints=joints,
        cuts=cuts,
    )


@names_damage
def read_rigs(
    path, skeleton: str | None = None, head: str | None = None, joints: dict[str, str] | None = None
) -> tuple[StageRig, ...]:
    """The characters and motion of a file, animated or not, without grooms; the first with its whole body.

    Args:
        path: a USD file.
        skeleton: prim path of the one wanted; all if left out.
        head: joint that is the head, if its name does not tell.
        joints: semantic joint -> joint, if names are not enough.
    """
    stage, skeleton = open_stage(path), prim_path(skeleton, "skeleton")
    border = Border.of(stage)
    rigs, unusable = _rigs(stage, border, skeleton, head, Path(path), all_shapes=True, joints=joints)
    first, every = rigs[0], rigs
    if skeleton is not None:
        every = [*rigs, *Others(rigs, stage, head, joints).maybe_same()]
    body, left = whole_body(first, every)
    first.notes.extend(unusable + partial_body(first, left))
    return replace(first, character=replace(first.character, body=body)), *rigs[1:]


def frame_range(stage: Usd.Stage, rigs) -> tuple[float, float]:
    """First and last time code: the stage's own, otherwise the animation's."""
    if stage.HasAuthoredTimeCodeRange():
        first, last = float(stage.GetStartTimeCode()), float(stage.GetEndTimeCode())
        if np.isfinite([first, last]).all() and first <= last:
            return first, last
    return float(min(r.time_codes[0] for r in rigs)), float(max(r.time_codes[-1] for r in rigs))


def check_frames_named(subject, frames, first: float, last: float, rigs) -> None:
    """Refuse to let a wind blow on rigs without an animation in frames that nothing names: neither `frames` nor a range from the first
    time code to the last.
    """
    if frames is None and first == last and not any(rig.joints.animated for rig in rigs):
        raise NeuralocksError(
            f"{subject}: has neither an animation nor a range of frames; name those in which the wind blows with "
            "--frames FIRST:LAST"
        )


def check_cuts(cuts, rigs) -> None:
    """Refuse time codes of cuts at which no rig's animation could have one."""
    for cut in () if isinstance(cuts, dict) else cuts or ():
        if not any(within(cut, rig.time_codes, rig.border.frame) for rig in rigs):
            known = rigs[0].time_codes
            begins = any(abs(cut - rig.time_codes[0]) <= NEAR * rig.border.frame for rig in rigs)
            fact = "begins the animation" if begins else "lies outside the animation"
            raise NeuralocksError(
                f"--cuts {cut:g}: {fact}, which goes from {known[0]:g} to {known[-1]:g}; "
                "give the first time code after each cut"
            )


def _grooms(search: HairSearch, curves: list[Usd.Prim], notes: list[str]) -> list[StageGroom]:
    """The curves that are hair, read in bind-world metres."""
    found = []
    for prim in search.filled(curves):
        placement = Placement(prim)
        attachment = search.attachment(prim, placement)
        if attachment is not None:
            groom, beyond = groom_between(prim, attachment.to_bind, notes, drawn=attachment.drawn)
            found.append(StageGroom(str(prim.GetPath()), prim, groom, attachment, placement, beyond))
            notes += groom_notes(prim, groom, attachment.rig.border)
    return found


def _moving(grooms: list[StageGroom], notes: list[str]) -> list[StageGroom]:
    """The grooms whose skeleton is animated, with a note on the others; all if none is."""
    moving = [item for item in grooms if item.attachment.rig.joints.animated]
    if not moving:
        return grooms
    still = [item for item in grooms if not item.attachment.rig.joints.animated]
    notes += [stands_still(item.path, item.attachment.rig) for item in still]
    return moving


def _notes_on_motion(grooms: list[StageGroom]) -> list[str]:
    """Notes on what carries the grooms, once for all grooms of a joint, because each reads the whole motion.

    Raises:
        NeuralocksError: a joint that the network reads has no rotation.
    """
    notes = []
    for attachment in {item.attachment.character: item.attachment for item in grooms}.values():
        carrying = attachment.carrying
        if stops := without_turn(carrying):
            raise NeuralocksError(stops[0])
        notes += rig_notes(attachment.rig) if attachment.off_head else untrained(carrying) + rig_notes(carrying)
    return notes


def _rigs(stage, border, skeleton, head, path, *, joints, **options) -> tuple[list[StageRig], list[str]]:
    """The skeletons that can be used, and the notes on those that cannot."""
    prims = find_skeletons(stage, skeleton)
    if not prims:
        raise no_skeleton(stage, path)
    rigs, errors = read_each_rig(stage, prims, border, head, joints=joints, **options)
    if errors and (not rigs or skeleton):
        raise errors[0]
    return rigs, few([left_out(error) for error in errors], "skeletons are left out")


def _check_animated(rigs: list[StageRig]) -> None:
    if not any(rig.joints.animated for rig in rigs):
        raise NeuralocksError(not_animated(rigs[0]))
