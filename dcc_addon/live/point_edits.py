# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of live hair's points by others: applied transforms, a moved origin, applied modifiers. Live points are not the
hair's rest shape, so such edits are transferred to the rest shape, or refused with a message. A rest shape that was
deleted is restored.
"""

import zlib

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import inverse, transformed

from ..live_state import Followed, Written
from ..scene.character.armature import matrix
from ..scene.hair import curves
from ..scene.objects.lookup import identity
from ..session import session

ROUNDING = 1e-5
"""Points that differ by less than this, relative to the largest coordinate, are the same."""


def write(hair, points: np.ndarray, world: np.ndarray, rest: np.ndarray) -> None:
    """Show points (P, 3) of hair that stands at `world` (4, 4), and remember them and its rest shape (P, 3)."""
    curves.write(hair.data, points)
    of, places = (identity(hair), identity(hair.data)), (matrix(hair.matrix_basis), world)
    before = session.shown.written.get(hair.name_full)
    if before is not None and before.of == of and before.points.shape == points.shape:
        kept, spare = before.points, before.spare
        np.copyto(kept, points)
    else:
        kept, spare = points.copy(), np.empty_like(points)
    session.shown.written[hair.name_full] = Written(of, kept, places, tuple(hair.modifiers.keys()), rest, spare)


def forget(hair) -> None:
    """The points were put back: what was written to this hair no longer counts, nor to another object with the same curves."""
    data, own = identity(hair.data), hair.name_full
    session.shown.written = {
        name: each for name, each in session.shown.written.items() if name != own and each.of[1] != data
    }


def intact(hair) -> bool:
    """Whether the hair has the curves that were written to last, with the same number of points. If so, each point has a rest
    shape; points joined since then may have none.
    """
    before, data = session.shown.written.get(hair.name_full), hair.data
    if before is None or before.of != (identity(hair), identity(data)):
        return False
    return len(before.points) == len(data.points)


def touched(hair) -> bool:
    """Whether something was done to the points since they were written, or their rest shape is gone. Modifiers that were removed
    without effect are forgotten.
    """
    before, data = session.shown.written.get(hair.name_full), hair.data
    if before is None or before.of[0] != identity(hair):
        return False
    if len(before.points) == len(data.points):
        if np.array_equal(curves.shown(data, before.spare), before.points):
            session.shown.written[hair.name_full] = before._replace(modifiers=tuple(hair.modifiers.keys()))
            return not curves.has_rest(data)
        if before.of[1] == identity(data):
            return True
    # Other strands, or another object's curves, are not an edit; the result of an applied modifier is, and may be in new curves.
    return bool(_applied(hair, before))


def follow(hair, sampled, world: np.ndarray) -> None:
    """Apply to the rest shape what was done to the points since they were written, if anything was.

    Args:
        hair: the hair object.
        sampled: the `SampledRig` that carries it.
        world: where it stands now (4, 4).

    Raises:
        NeuralocksError: it cannot follow, for example after a modifier was applied to moved hair; live is then off.
    """
    name, data = hair.name_full, hair.data
    before = session.shown.written.get(name)
    if before is None and curves.has_rest(data) and _follow_again(hair):
        sampled.stale = session.sampling.wanting = True  # it may have stood elsewhere then
    if not touched(hair):
        return
    now = curves.shown(data)
    del session.shown.written[name]
    same = len(now) == len(before.points)
    if same and not curves.has_rest(data):
        curves.put_aside(data, before.rest)
        if np.array_equal(now, before.points):
            return
    # What is applied to the points is removed from the object's own transform; or, if its parent's was applied with it, from its
    # world transform.
    for then, place in zip(before.places, (matrix(hair.matrix_basis), world), strict=True) if same else ():
        change = inverse(place) @ then
        moved = transformed(before.points, change)
        if np.abs(moved - now).max() <= ROUNDING * np.abs(moved).max():
            break
    else:
        change = [*_applied(hair, before), "its points were changed"][0]
    session.shown.followed.append(Followed(identity(data), _checksum(data), now, change))
    if isinstance(change, str):
        _refuse(hair, change)
    curves.move_rest(data, change)
    session.doubtful.add(name)
    if name in sampled.bind_places:  # the hair is where it was, in another space
        back = inverse(change)
        sampled.bind_places[name] = sampled.bind_places[name] @ back
        sampled.motion.places[name] = sampled.motion.places[name] @ back


def _applied(hair, before: Written) -> list[str]:
    """What modifiers that are gone did to the hair."""
    return [f"'{name}' was applied to it" for name in before.modifiers if name not in hair.modifiers]


def _refuse(hair, what: str) -> None:
    hair.neuralocks_hair.live = False
    raise NeuralocksError(
        f"{hair.name_full}: {what} while Live was on, and that change is lost, since its rest shape cannot follow; "
        "undo, turn Live off, and do it again"
    )


def _follow_again(hair) -> bool:
    """Repeat on the rest shape what was done to the points, if an undo has brought them back; returns whether anything was ever
    done to them.
    """
    data = hair.data
    own = [each for each in session.shown.followed if each.of == identity(data)]
    if own:
        now, rest = curves.shown(data), _checksum(data)
        again = [each.change for each in own if each.rest == rest and np.array_equal(each.points, now)]
        if again and isinstance(again[0], str):
            _refuse(hair, again[0])
        if again:
            curves.move_rest(data, again[0])
    return bool(own)


def _checksum(data) -> int:
    return zlib.crc32(curves.points(data))
