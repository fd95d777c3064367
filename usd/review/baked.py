# SPDX-License-Identifier: Apache-2.0
"""A bake read back: what a renderer would see of it, in metres."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from pxr import UsdGeom

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.preview.film import Scene
from neuralocks_core.rotation import transformed

from ..border.values import as_numbers
from ..shot.bakes.bake_record import recorded_cuts, recorded_joint, retimed
from ..shot.bakes.gaps import gaps, some
from ..shot.carriers.twin_bodies import one_person
from ..shot.made_from import baked_from_others
from ..shot.stage import Shot, StageGroom, read_shot
from ..skel.stage_rig import StageRig
from ..skel.surface import drawn

MOST_BODY_POINTS = 400_000
"""Largest number of body points drawn in a preview."""


class NotBaked(NeuralocksError):
    """No groom of a stage has samples.

    Attributes:
        shot: the stage.
    """

    def __init__(self, text: str, shot: Shot):
        super().__init__(text)
        self.shot = shot


@dataclass(frozen=True)
class Baked:
    """A stage whose grooms have point samples.

    Attributes:
        shot: the stage.
        codes: time codes (T,) at which some groom has a sample, ascending.
    """

    shot: Shot
    codes: np.ndarray = field(repr=False)
    _joints: dict[str, np.ndarray] = field(default_factory=dict, init=False, repr=False, compare=False)
    _shapes: dict[str, np.ndarray] = field(default_factory=dict, init=False, repr=False, compare=False)

    @cached_property
    def times(self) -> np.ndarray:
        """(T,) [s]."""
        return self.shot.border.seconds(self.codes)

    def joints(self, rig: StageRig) -> np.ndarray:
        """World joint transforms (T, J, 4, 4) [m] of a skeleton at all time codes, read once for all its grooms; do not modify them."""
        if rig.path not in self._joints:
            self._joints[rig.path] = np.stack([rig.joints_at(code) for code in self.codes])
        return self._joints[rig.path]

    def shapes(self, rig: StageRig) -> np.ndarray:
        """The same for blend shape weights (T, B)."""
        if rig.path not in self._shapes:
            self._shapes[rig.path] = np.stack([rig.shape_at(code) for code in self.codes])
        return self._shapes[rig.path]

    def alone(self, item: StageGroom) -> "Baked":
        """The same, only at one groom's own samples: between them its points move along chords, unlike hair."""
        return replace(self, codes=np.array(UsdGeom.BasisCurves(item.prim).GetPointsAttr().GetTimeSamples()))

    def world(self, item: StageGroom, code: float) -> np.ndarray:
        """Points (P, 3) of a groom, as it is drawn, at a time code, world metres.

        Raises:
            NeuralocksError: they are missing, not as many as at rest, or not finite.
        """
        attribute = UsdGeom.BasisCurves(item.prim).GetPointsAttr()
        points = as_numbers(attribute, "point3f[]", attribute.Get(code))
        if len(points) != item.point_count:
            raise NeuralocksError(
                f"{item.path}: {len(points)} points at time code {code:g}, {item.point_count} at rest; bake again"
            )
        if not np.isfinite(points).all():
            raise NeuralocksError(f"{item.path}: points at time code {code:g} are not finite; bake again")
        points = points if item.beyond is None else points[item.beyond.hair]
        return transformed(points, self.shot.border.to_core @ item.placement.at(code))

    def canonical(self, item: StageGroom, frame: int) -> np.ndarray:
        """The same at one of the time codes, in canonical space, where the rigidly carried groom stands still."""
        joints = self.joints(item.attachment.rig)[frame]
        return transformed(
            self.world(item, self.codes[frame]), np.linalg.inv(item.attachment.character.canonical_to_world(joints))
        )

    @property
    def shown(self) -> list[StageGroom]:
        """The grooms that are not hidden; all, if all are."""
        return [item for item in self.shot.grooms if drawn(item.prim)] or list(self.shot.grooms)

    @property
    def drawn(self) -> list[StageGroom]:
        """Those of them that a preview draws: of the first one's person."""
        return [item for item in self.shown if self.is_first(item.attachment.rig)]

    def is_first(self, rig: StageRig) -> bool:
        """Whether a skeleton is that of the first groom that is shown, or another one of the same person."""
        first = self.shown[0].attachment.rig
        return rig is first or one_person(first, rig)

    def broken(self, items: Iterable[StageGroom]) -> list[str]:
        """The notes on frames that grooms lack between others; a bake of a part of the shot is whole."""
        lines = []
        for item in items:
            if where := some(gaps(list(self.alone(item).codes), self.shot.border.frame)):
                fact = f"has no samples {where}, where hair moves along straight lines"
                lines.append(f"{item.path}: {fact}; bake these frames, too")
        return lines

    def scene(self) -> Scene:
        """All hair and the body of the first groom's person, for a preview; what is hidden only if nothing else is there."""
        first, items = self.shown[0].attachment, self.drawn
        character, rig = first.character, first.rig
        body = character.body if character.body is not None and len(character.body.points) <= MOST_BODY_POINTS else None
        head = np.stack([character.carrying(rig.joints_at(code)) for code in self.codes])
        to_bind = character.canonical_to_bind

        def pose(frame: int) -> np.ndarray:
            code = self.codes[frame]
            return character.posed_body(rig.joints_at(code), rig.shape_at(code))

        return Scene(
            times=self.times,
            head=head,
            facing=character.facing,
            centre=transformed(character.head_centre, to_bind),
            counts=np.concatenate([item.groom.counts for item in items]),
            rest=np.concatenate([item.groom.points for item in items]).astype(float),
            hair=lambda frame: np.concatenate([self.world(item, self.codes[frame]) for item in items]),
            triangles=None if body is None else body.triangles,
            body=None if body is None else pose,
            body_rest=None if body is None else body.points,
            cuts=() if rig.clip.loop else rig.clip.cuts,
            size=character.times_human,
            collar=character.collar,
        )


def read_baked(path, grooms=None, skeleton: str | None = None, head: str | None = None, joints=None) -> Baked:
    """Read a bake of any tool: a stage with a skeleton and grooms whose points are sampled over time.

    Arguments are as for `bake`, which records the skeleton and the joint that carry hair: no user need name them again. If some
    grooms have samples, those without are left out, with a note.

    Raises:
        NotBaked: no groom has samples.
        NeuralocksError: it cannot be read.
    """

    def read(head, cuts=None) -> Shot:
        return read_shot(path, grooms, skeleton, head, joints, cuts, still=True, as_baked=True)

    shot = read(head)
    if head is None and (head := _named_head(shot)):
        shot = read(head)
    told = [(item.attachment.rig.path, recorded_cuts(item.prim)) for item in shot.grooms]
    told = {path: cuts for path, cuts in told if cuts is not None}
    if told:
        shot = read(head, told)
    sampled = {item.path: UsdGeom.BasisCurves(item.prim).GetPointsAttr().GetTimeSamples() for item in shot.grooms}
    if not any(sampled.values()):
        raise NotBaked(
            f"{path}: its grooms have no animated points; bake it first: neuralocks bake {path} -o OUT.usdc", shot
        )
    # Exporters write one sample for what stands still: next to moving hair, that is not a bake.
    least = min(2, max(len(codes) for codes in sampled.values()))
    items = tuple(item for item in shot.grooms if len(sampled[item.path]) >= least)
    left = [f"{path}: its points do not move; left out" for path, codes in sampled.items() if len(codes) < least]
    old = [note for item in items for note in baked_from_others(item.prim, item.attachment, item.groom)]
    old += [note for item in items for note in retimed(item.prim)]
    codes = sorted({code for item in items for code in sampled[item.path]})
    baked = Baked(replace(shot, grooms=items), np.array(codes))
    return replace(baked, shot=replace(baked.shot, notes=(*shot.notes, *left, *old, *baked.broken(items))))


def _named_head(shot: Shot) -> str | None:
    """The joint that hair was baked with, if names find another one; None if they agree, or no single one is recorded."""
    told = {recorded_joint(item.prim) for item in shot.grooms if recorded_joint(item.prim) not in (None, item.joint)}
    known = {name for rig in shot.rigs for name in rig.joints.names}
    return told.pop() if len(told) == 1 and told <= known else None
