# SPDX-License-Identifier: Apache-2.0
"""How far hair at rest lies from hair that a model has learned."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.strands.strand_set import StrandSet

LOOKED_AT = (0, 3, 6, 9, 12, 15, 19, 23)
"""Vertices of a strand that tell where it lies and how it winds."""
KEPT = 1000
"""Strands in a model's card, at most: 85 kB of text."""
LARGEST = 10_000
"""Millimetres, and strands, that a card may hold: it comes from a file."""


def learned_hair(grooms: Sequence[StrandSet]) -> list[str]:
    """Strands of a training for its card, the same number of each groom: millimetres of their LOOKED_AT vertices from the head's
    centre, canonical space, as text, since a number a line would be ten times as long.
    """
    each = max(1, KEPT // max(1, len(grooms)))
    places = np.concatenate([_places(groom)[spread(int(groom.valid.sum()), each)] for groom in grooms])
    return [" ".join(map(str, row)) for row in np.round(1000 * places).astype(int)]


class Learned:
    """The hair of a model's card.

    Args:
        told: what `learned_hair` wrote, from a file that may contain anything.

    Raises:
        ValueError: it is not that.
    """

    def __init__(self, told):
        if not isinstance(told, list) or not 0 < len(told) <= LARGEST or not all(isinstance(row, str) for row in told):
            raise ValueError("no strands")
        try:
            places = np.array([[int(word) for word in row.split()] for row in told], float) / 1000
        except OverflowError:
            raise ValueError("no strands") from None
        if places.shape != (len(told), 3 * len(LOOKED_AT)) or np.abs(places).max() > LARGEST / 1000:
            raise ValueError("no strands")
        self._tree = cKDTree(places)

    def distance(self, strands: StrandSet) -> float:
        """How far half of the strands at most lie from the nearest learned one: root mean square of their vertices' distances [m];
        infinite if none is valid.
        """
        places = _places(strands)
        if not len(places):
            return np.inf
        return float(np.median(self._tree.query(places)[0])) / len(LOOKED_AT) ** 0.5


def _places(strands: StrandSet) -> np.ndarray:
    """LOOKED_AT vertices of the valid strands from the head's centre, in one row each [m]."""
    rest = strands.rest[strands.valid][:, LOOKED_AT] - strands.head_centre
    return rest.reshape(len(rest), 3 * len(LOOKED_AT)).astype(float)


def spread(count: int, wanted: int) -> np.ndarray:
    """Indices of at most so many of `count` things, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, wanted)).astype(int)) if count else np.zeros(0, int)
