# SPDX-License-Identifier: Apache-2.0
"""Which of the shipped models moves a groom. One has learned all styles of the library; the others a few of them each, or one, and
those better. A groom that lies close to what one of these has learned is moved by it, all others by the first.
"""

import os
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from neuralocks_core.models import model_file
from neuralocks_core.strands.resemblance import Learned, spread
from neuralocks_core.strands.strand_set import StrandSet, strands_on

NEAR = 0.035
"""A model knows hair of which half the strands are no farther than this [m] from the nearest that it has learned. Grooms of its
styles from other seeds are 6 to 18 mm away, variations of them that it has not seen 12 to 37 mm. Up to here, it moves these with
smaller errors than the model for all (`benchmarks/nearness.py`)."""
SOME = 300
"""So many strands tell where all are."""


def suited(path: str | os.PathLike | None, character: Character, groom: Groom) -> Path:
    """The file of the model that moves a groom: the one named, else the shipped one that knows such hair best. It depends on nothing
    but the groom at rest and the head that carries it.

    Args:
        path: the model that the user named, in whatever spelling; None if there is none.
        character: whose head carries the hair.
        groom: in bind-world metres.
    """
    if path is not None:
        return Path(path)
    return nearest(strands_on(character, groom.subset(spread(groom.strand_count, SOME))))


def nearest(strands: StrandSet) -> Path:
    """The shipped model for these strands."""
    far = distances(strands)
    best = min(far, key=far.get, default=None)
    return best if best is not None and far[best] <= NEAR else model_file.shipped()


def distances(strands: StrandSet) -> dict[Path, float]:
    """How far strands lie from what each specialist has learned [m]."""
    return {path: learned.distance(strands) for path, learned in _specialists().items()}


def nearest_to_all(grooms: Iterable[StrandSet]) -> Path:
    """The shipped model that a training of these grooms begins with: the one for all hair if they are of several kinds."""
    found = {nearest(strands.subset(spread(len(strands.rest), SOME))) for strands in grooms}
    return found.pop() if len(found) == 1 else model_file.shipped()


@cache
def _specialists() -> dict[Path, Learned]:
    """The shipped models for some styles, with what they have learned."""
    return {path: _learned(path) for path in model_file.specialists()}


def _learned(path: Path) -> Learned:
    told = model_file.read(path, "strands").meta["training"].get("hair")
    try:
        return Learned(told)
    except ValueError:
        raise NeuralocksError(f"{path}: does not tell which hair it knows; install neuralocks again") from None
