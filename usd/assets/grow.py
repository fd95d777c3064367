# SPDX-License-Identifier: Apache-2.0
"""`neuralocks grow`: hairstyles of the procedural library on any character."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from neuralocks_core.arguments import flag
from neuralocks_core.body.collider import Collider
from neuralocks_core.body.head_field import head_field
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import as_path, check_writable
from neuralocks_core.groom import LARGEST_COORDINATE, Groom
from neuralocks_core.hairstyles import Obstacle, Scalp, check_style, from_head
from neuralocks_core.hairstyles import grow as grow_style
from neuralocks_core.hairstyles.fitting import Fitted, fit
from neuralocks_core.progress import Progress, silent, within

from ..border.stage_files import check_layer_name, check_not_input, check_not_over
from ..shot.notes.skeleton_notes import first_of, unlikely_head
from ..shot.stage import read_rigs
from ..shot.strands.curves import find_curves
from ..skel.stage_rig import StageRig
from .groom import Over, write_groom

HOLLOW = 0.003
"""Skin of the head that is deeper than this [m] where its hollows count as inside is in one of them."""

_SEEN, _GROWN = 120, 930
"""Progress, in thousandths of the work for many strands, once the head is read and once the hair is grown."""


def grow(
    style: str,
    character: str | Path,
    out: str | Path,
    count: int = 10_000,
    seed: int = 0,
    *,
    variation: int = 0,
    skeleton: str | None = None,
    head: str | None = None,
    with_character: bool = False,
    replaced=None,
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Grow a hairstyle on the head of a USD character and write it as a USD groom, in the unit and axis of its file.

    Args:
        style: one of `neuralocks_core.hairstyles.STYLES`.
        character: USD file with a skeleton and skinned meshes.
        out: USD file to write.
        count: strands, 1 to 150,000.
        seed: the same seed gives the same groom.
        variation: number of a variation of the style, cut, parted, waved and laid differently; 0 is the style itself.
        skeleton, head: as for `bake`.
        with_character: write a layer over the character's file, which can be opened and baked as it is.
        replaced: prim paths of hair in that file that the new hair replaces: it is inactive in the layer.
        tell: called with notes for the user.
        progress: called with (done, total, message).

    Raises:
        NeuralocksError: an unknown style, a number out of range, no head with skin, or a file that cannot be written.
    """
    out, with_character = as_path(out, "out"), flag("--with-character", with_character)
    check_layer_name(out)
    check_style(style, count, variation, seed)
    rig, over, notes = whose_head(character, skeleton, head, out, with_character, replaced)
    check_writable(out)
    if tell:
        tell(notes)
    say = progress or silent
    say(0, 1000, "looking at the head")
    groom = Barber(rig.character).grow(style, count, seed, variation, within(say, _SEEN, _GROWN))
    say(_GROWN, 1000, f"writing {out.name}")
    return write_groom(out, groom, rig, over)


def whose_head(
    character, skeleton: str | None, head: str | None, out: Path, with_character: bool, replaced
) -> tuple[StageRig, Over | None, list[str]]:
    """The character that gets hair, what the hair is written over, if anything, and what a user should know of both.

    Args:
        character, skeleton, head, with_character, replaced: as for `grow`.
        out: checked not to be one of the character's files.
    """
    if replaced and not with_character:
        raise NeuralocksError(
            "--replace: only a layer over the character's file replaces hair in it; add --with-character"
        )
    rigs = read_rigs(character, skeleton, head)
    rig = rigs[0]
    stage, over = rig.joints.prim.GetStage(), None
    (check_not_over if with_character else check_not_input)(out, stage)
    if with_character:
        over = Over(rig, as_path(character, "character"), find_curves(stage, replaced) if replaced else [])
    return rig, over, [*first_of(rigs), *rig.notes, *unlikely_head(rig), *(over.notes() if over else [])]


class Barber:
    """Grows styles on one character, or puts others' hair on it; the head is read only once."""

    def __init__(self, character: Character):
        if character.body is None:
            raise NeuralocksError("character: hair needs a head to grow on; give a character with skin, or a groom")
        if not (np.abs(character.body.points) <= LARGEST_COORDINATE).all():  # no groom could lie there
            raise NeuralocksError(
                f"character: its skin reaches farther than {LARGEST_COORDINATE:g} m from the origin; check metersPerUnit, and "
                "scale and place of the skeleton and the prims above it"
            )
        self.character = character

    def grow(self, style: str, count: int, seed: int, variation: int = 0, progress: Progress | None = None) -> Groom:
        """A groom in bind-world metres."""
        groom = grow_style(style, self._scalp, count, seed, self._obstacle, variation, progress)
        return replace(groom, points=(groom.points @ self.character.facing).astype(np.float32))

    def fitted(self, grooms: Sequence[Groom], resize: bool) -> Fitted:
        """Grooms that were made for another head, on this one, in bind-world metres; see `fitting.fit`."""
        found = fit(grooms, self._scalp, Collider(self._scalp.points, self._open_skin), resize)
        turned = [replace(g, points=(g.points @ self.character.facing).astype(np.float32)) for g in found.grooms]
        return replace(found, grooms=turned)

    @cached_property
    def _scalp(self) -> Scalp:
        # Styles are grown facing +Z, around the head's own position.
        centre = self.character.facing @ self.character.canonical_to_bind[:3, 3] + self.character.head_centre
        points = self.character.body.points @ self.character.facing.T
        return from_head(points, self._skin, centre, self.character.times_human)

    @cached_property
    def _skin(self) -> np.ndarray:
        # Hair does not grow on a hat.
        triangles = self.character.body.triangles
        return triangles[self.character.skin[triangles[:, 0]]]

    @property
    def _open_skin(self) -> np.ndarray:
        # Nor in a mouth, a nostril or an eye's socket.
        character = self.character
        points = character.canonical(character.body.points) / character.times_human
        depth = head_field(points, self._skin, character.on_head).distance(points[self._skin].mean(axis=1))[0]
        return self._skin[depth > -HOLLOW]

    @cached_property
    def _obstacle(self) -> Obstacle:
        return Obstacle(self._scalp, (self._scalp.points, self.character.body.triangles))
