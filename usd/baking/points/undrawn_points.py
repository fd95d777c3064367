# SPDX-License-Identifier: Apache-2.0
"""The points beyond the ends of drawn curves, which a network does not see: each turns with the edge next to it."""

import numpy as np

from neuralocks_core.sums import times

from ...shot.strands.curve_ends import Beyond

SHORT = 0.01
"""An edge shorter than this share of the distance to the point gives it no direction."""


class UndrawnPoints:
    """Writes the drawn points of a groom, and the points beyond their ends that go with them, to the array of all its points.

    Args:
        beyond: which points are beyond the ends.
        points: (P, 3) all points at rest in the prim's own space.
        linear: (3, 3) from that space to bind world [m].
    """

    def __init__(self, beyond: Beyond, points: np.ndarray, linear: np.ndarray):
        self._hair = np.flatnonzero(beyond.hair)
        own = np.concatenate([beyond.before, beyond.after])
        inward = np.repeat([1, -1], [len(beyond.before), len(beyond.after)])
        order = np.argsort(own)
        self._own, inward = own[order], inward[order]
        number = np.cumsum(beyond.hair) - 1
        # The edge that each point extends, as indices of drawn points.
        self._near, self._far = number[self._own + inward], number[self._own + 2 * inward]
        near, far = points[self._own + inward].astype(float), points[self._own + 2 * inward].astype(float)
        self._offset, self._edge = times(linear, points[self._own] - near), times(linear, far - near)

    def put(self, drawn: np.ndarray, first: int, linear: np.ndarray, rest: np.ndarray | None, into: np.ndarray) -> None:
        """Fill in the points of some consecutive strands.

        Args:
            drawn: (n, 3) float32, the strands' drawn points, as placed.
            first: index of the first one among all drawn points.
            linear: (3, 3) from bind world to the space they are placed in.
            rest: (P, 3) float32 all points at rest in that space, if the groom stands where it rests: unmoved points keep their
                exact bits.
            into: (P, 3) float32 all points.
        """
        into[self._hair[first : first + len(drawn)]] = drawn
        some = slice(*np.searchsorted(self._near, [first, first + len(drawn)]))
        own, near, far = self._own[some], self._near[some] - first, self._far[some] - first
        offset = times(linear, self._offset[some])
        edge = drawn[far].astype(float) - drawn[near]
        into[own] = drawn[near] + _turned(offset, times(linear, self._edge[some]), edge)
        if rest is not None:
            still = (drawn[[near, far]] == rest[self._hair[[self._near[some], self._far[some]]]]).all(axis=(0, 2))
            into[own[still]] = rest[own[still]]


def _turned(vectors: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) turned as edges `before` turn to `after` by the smallest rotation; unchanged where an edge is short.

    Written out term by term: the result for one vector must not depend on how many there are.
    """
    length = _length(vectors)
    told = (np.minimum(_length(before), _length(after)) > SHORT * length) & (length > 0)
    a, b = (edge / np.where(told, _length(edge), 1.0) for edge in (before, after))
    cosine, axis = np.sum(a * b, axis=-1, keepdims=True), np.cross(a, b)
    along = axis * np.sum(axis * vectors, axis=-1, keepdims=True) / np.maximum(1 + cosine, 1e-9)
    return np.where(told, cosine * vectors + np.cross(axis, vectors) + along, vectors)


def _length(vectors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sum(vectors * vectors, axis=-1, keepdims=True))
