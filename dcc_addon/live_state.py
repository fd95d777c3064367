# SPDX-License-Identifier: GPL-3.0-or-later
"""What the session keeps in memory for each live object."""

from typing import NamedTuple

import numpy as np

from .services.hair.bones import LiveBones
from .services.hair.live import LiveHair


class Prepared(NamedTuple):
    """A hair object bound to its model.

    Attributes:
        hair: what gives its points.
        made_of: if it changes, the hair must be made again; begins with the checksum of `rest`.
        rest: points (P, 3) of the groom in the object's space.
        of, file: show quickly that the object has other curves (`_which`), or that the model file was replaced.
    """

    hair: LiveHair
    made_of: tuple
    rest: np.ndarray
    of: tuple
    file: tuple


class Bound(NamedTuple):
    """A rig model bound to an armature.

    Attributes:
        bones: the hair bones.
        modes: the rotation mode in which each bone is turned, by bone.
        file: the model file, and a stamp that changes when it is replaced.
    """

    bones: LiveBones
    modes: dict[str, str]
    file: tuple


class Written(NamedTuple):
    """What the live view wrote last.

    Attributes:
        of: the hair object and the curves that it was written to.
        points: (P, 3) float32 in the object's space.
        places: the object's transforms (4, 4) then, its own and in the world.
        modifiers: names of its modifiers.
        rest: the rest shape, (P, 3) float32.
        spare: (P, 3) float32, memory for reading the current points. Like that of `points`, it is kept from frame to frame:
            allocating large memory costs more than the work in it.
    """

    of: tuple
    points: np.ndarray
    places: tuple[np.ndarray, np.ndarray]
    modifiers: tuple[str, ...]
    rest: np.ndarray
    spare: np.ndarray


class Followed(NamedTuple):
    """What was once done to points. An undo goes back to before it was done to their rest shape, because Blender stores each step
    before it reports it; this lets us recognise it again.

    Attributes:
        of: the curves.
        rest: checksum of the rest shape before.
        points: (P, 3) float32 afterwards.
        change: the transform (4, 4); or, in words, why the rest shape cannot follow.
    """

    of: object
    rest: int
    points: np.ndarray
    change: np.ndarray | str


class Stood(NamedTuple):
    """The state of a live hair object when it was last written.

    Attributes:
        points: as shown, (P, 3) float32 in its own space.
        world: where it stood (4, 4).
        root: the first point of its rest shape.
        rest: checksum of all points of its rest shape.
    """

    points: np.ndarray
    world: np.ndarray
    root: np.ndarray
    rest: int


class Key(NamedTuple):
    """What a sampling of an armature depends on besides its animation: timing, chosen head and the names of all that is read."""

    timing: tuple
    head_bone: str
    bones: tuple[str, ...]
    bodies: tuple[str, ...]
    hairs: tuple[str, ...]
