# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of live hair's points by others: applied transforms, a moved origin, applied modifiers. Live points are not the
hair's rest shape, so what was done to them is done to that.
"""

import zlib
from typing import NamedTuple

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import inverse, transformed

from .scene import curves
from .scene.armature import matrix
from .scene.lookup import identity
from .session import session

ROUNDING = 1e-5
"""Points that differ by less, relative to the largest coordinate, are the same."""
KEPT = 7
"""Earlier changes that are known again."""


class Written(NamedTuple):
    """What the live view wrote last.

    Attributes:
        of: the curves that it was written to.
        points: (P, 3) float32 in the object's space.
        places: the object's transforms (4, 4) then, its own and in the world.
        modifiers: names of its modifiers.
    """

    of: object
    points: np.ndarray
    places: tuple[np.ndarray, np.ndarray]
    modifiers: tuple[str, ...]


class Followed(NamedTuple):
    """What was done to points once. An undo goes back to before it was done to their rest shape, because Blender remembers
    each step before it tells of it; it is then known again by this.

    Attributes:
        of: the curves.
        rest: checksum of the rest shape before.
        points: (P, 3) float32 after.
        change: the transform (4, 4).
    """

    of: object
    rest: int
    points: np.ndarray
    change: np.ndarray


def write(hair, points: np.ndarray, world: np.ndarray) -> None:
    """Show points (P, 3) of hair that stands at `world` (4, 4), and remember them."""
    curves.write(hair.data, points)
    places = matrix(hair.matrix_basis), world
    session.written[hair.name_full] = Written(identity(hair.data), points.copy(), places, tuple(hair.modifiers.keys()))


def touched(hair) -> bool:
    """Whether something was done to the points since they were written."""
    before, data = session.written.get(hair.name_full), hair.data
    if before is None or before.of != identity(data) or len(before.points) != len(data.points):
        return False
    return not np.array_equal(curves.shown(data), before.points)


def follow(hair, sampled, world: np.ndarray) -> None:
    """Let the rest shape follow what was done to the points since they were written, if anything was.

    Args:
        hair: the hair object.
        sampled: the `SampledRig` that carries it.
        world: where it stands now (4, 4).

    Raises:
        NeuralocksError: it cannot, after a modifier was applied to moved hair, say; live is off then.
    """
    name, data = hair.name_full, hair.data
    before = session.written.get(name)
    if not curves.has_rest(data):
        return
    if before is None and _follow_again(data):
        sampled.stale = session.wanting = True  # it may have stood otherwise then
    if not touched(hair):
        return
    now = curves.shown(data)
    del session.written[name]
    # What is applied to the points is taken from the object's own transform; or, where its parent's was applied with it,
    # from where it stands in the world.
    for then, place in zip(before.places, (matrix(hair.matrix_basis), world), strict=True):
        change = inverse(place) @ then
        moved = transformed(before.points, change)
        if np.abs(moved - now).max() <= ROUNDING * np.abs(moved).max():
            break
    else:
        gone = [f"'{modifier}' was applied to it" for modifier in before.modifiers if modifier not in hair.modifiers]
        hair.neuralocks_hair.live = False
        raise NeuralocksError(
            f"{name}: {[*gone, 'its points were changed'][0]} while it was moved; that is lost, because Live puts "
            "the points back to rest; undo, and do it with Live off"
        )
    session.followed[:] = [*session.followed[-KEPT:], Followed(before.of, _checksum(data), now, change)]
    curves.move_rest(data, change)
    session.doubtful.add(name)
    if name in sampled.bind_places:  # the hair is where it was, in another space
        back = inverse(change)
        sampled.bind_places[name] = sampled.bind_places[name] @ back
        sampled.motion.places[name] = sampled.motion.places[name] @ back


def _follow_again(data) -> bool:
    """Do to the rest shape what was done to the points, where an undo has brought these back; whether anything was ever
    done to them.
    """
    own = [each for each in session.followed if each.of == identity(data)]
    if own:
        now, rest = curves.shown(data), _checksum(data)
        again = [each.change for each in own if each.rest == rest and np.array_equal(each.points, now)]
        if again:
            curves.move_rest(data, again[0])
    return bool(own)


def _checksum(data) -> int:
    return zlib.crc32(np.ascontiguousarray(curves.points(data)))
