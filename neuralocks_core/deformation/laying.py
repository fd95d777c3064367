# SPDX-License-Identifier: Apache-2.0
"""Strands laid over a body where they are inside it, with every segment's length kept."""

import numpy as np

from neuralocks_core.body.entry_depth import depths_along
from neuralocks_core.body.near_body import PosedBody
from neuralocks_core.strands.strand_set import CLAMPED
from neuralocks_core.sums import dot_apart

MARGIN = 0.001
"""Clearance that a pushed vertex gets [m]."""
SLACK = np.float32(1e-5)
"""Tolerance [m], so that hair that may rest inside is not pushed because of rounding in the network's output."""
TRIES = 2
"""Planes that a vertex is laid on, one after another: each is measured where the one before has put it."""
FLAT = 0.004
"""A vertex that a plane moves by less than this [m] is not measured again: nearby skin bends away by less than the margin."""
BACK = 0.3
"""A pushed strand bends back towards its wanted place, each segment by at most this share of its length."""
UNSEEN = 0.012
"""An unknown distance outside is at least this [m]."""
STEEP = 0.003
"""How much more than its length a segment may seem to go down [m]: the largest error of distances."""


NEVER, CHECKED, ALWAYS = 0, 1, 2
"""Whether a strand is laid: not at all, if a vertex is nearer than it may be, or without asking."""


def keep_out(displacement: np.ndarray, rest: np.ndarray, clear: np.ndarray, watch: np.ndarray, body: PosedBody) -> None:
    """Lay strands over the body where they are inside it.

    Args:
        displacement: (S, K, 3) float32 [m] from rest, changed in place.
        rest: (S, K, 3) float32 [m], in the body's space.
        clear: distance (S, K) float32 [m] that each vertex must keep, -inf for those that never move.
        watch: (S,) uint8, NEVER, CHECKED or ALWAYS.
        body: in this pose.
    """
    compiled = body.compiled(rest.shape[1])
    if compiled is not None and displacement.flags.c_contiguous and displacement.dtype == np.float32:
        compiled.keep_out(displacement, rest, clear, watch)
        return
    laid = watch == ALWAYS
    laid[body.violated(rest + displacement, clear - SLACK)] = True
    rows = np.flatnonzero(laid & (watch != NEVER))
    displacement[rows] = resolved(rest[rows] + displacement[rows], body, clear[rows]) - rest[rows]


def resolved(points: np.ndarray, body: PosedBody, clear: np.ndarray) -> np.ndarray:
    """Strands laid over the surface where they were inside it.

    From the root of each strand on, and with every length kept, each segment keeps its wanted direction as nearly as the
    surface under its end allows. That surface is searched for from the vertex before, which is already outside, so it is at
    most a segment away, however deep the strand was wanted: the way out is clear, and changes little from one frame to the
    next. A strand depends only on itself and the body: neither the order of strands nor their division into chunks matters.
    Up to the first vertex that must give way, a strand stays the same, bit for bit.

    Args:
        points: deformed strands (S, K, 3) [m], in the body's space.
        body: in this pose.
        clear: distance [m] that each vertex must keep (S, K), -inf for those that never move.

    Returns:
        (S, K, 3) float32.
    """
    compiled = body.compiled(points.shape[1])
    return _resolved(points, body, clear) if compiled is None else compiled.laid(points, clear)


def rest_distance(points: np.ndarray, body: PosedBody) -> np.ndarray:
    """Signed distance (S, K) float32 [m] of strands (S, K, 3) at rest, measured as `resolved` does."""
    return _measured(np.ascontiguousarray(points.transpose(1, 2, 0)), body)[0].T


def clearance(rest_distance: np.ndarray) -> np.ndarray:
    """Distance (S, K) float32 [m] that each vertex must keep, from the signed distance in the bind pose (S, K) [m].

    Hair that rests inside the body, or closer than the margin, is not pushed beyond where it rests.
    """
    clear = np.minimum(rest_distance, MARGIN).astype(np.float32)
    clear[:, :CLAMPED] = -np.inf
    return clear


def _resolved(points: np.ndarray, body: PosedBody, clear: np.ndarray) -> np.ndarray:
    """What `keep_out.c` computes: its description, and what runs where that does not."""
    # Vertices first, strands last: what is done to one vertex of all strands is one contiguous array.
    wanted = np.ascontiguousarray(np.asarray(points, float).transpose(1, 2, 0))
    keep = np.ascontiguousarray(clear.T, float)
    distance, way = _measured(wanted, body)
    lack = (keep - distance).max(axis=0)
    todo = np.flatnonzero(lack > SLACK)
    if len(todo):
        some, low = wanted[:, :, todo], keep[:, todo]
        laid, hard = _laid(some, low, distance[:, todo], way[:, :, todo], body)
        if len(hard):
            # A strand that is not freed is not left deeper than it was.
            left = (low[:, hard] - _measured(laid[:, :, hard], body)[0]).max(axis=0)
            worse = hard[left > np.maximum(lack[todo[hard]], 0.5 * MARGIN)]
            laid[:, :, worse] = some[:, :, worse]
        wanted[:, :, todo] = laid
    return wanted.transpose(2, 0, 1).astype(np.float32)


def _measured(points: np.ndarray, body: PosedBody) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance (K, n) [m] of strands (K, 3, n) and its direction (K, 3, n), deep in the body too."""
    distance, way = body.distance(points.transpose(0, 2, 1).astype(np.float32))
    distance, way = distance.astype(float), way.transpose(0, 2, 1).astype(float)
    depths_along(points, distance, way)
    return distance, way


def _laid(wanted, keep, distance, way, body: PosedBody) -> tuple[np.ndarray, np.ndarray]:
    """Strands (K, 3, n) laid over the surface, and which (m,) of them may still be inside.

    Args:
        wanted: strands (K, 3, n) [m].
        keep: distance that each vertex must keep (K, n) [m].
        distance, way: signed distance (K, n) [m] and its direction (K, 3, n) of each wanted vertex; changed to those of
            the laid ones.
        body: in this pose.
    """
    result, edges = wanted.copy(), np.diff(wanted, axis=0)
    lengths = np.sqrt(np.square(edges).sum(axis=1))
    moved, hard = np.zeros((2, wanted.shape[2]), bool)
    first = (keep - distance > SLACK).argmax(axis=0)
    for i in range(max(1, int(first.min())), len(wanted)):
        before, length = result[i - 1], lengths[i - 1]
        end = np.where(moved, before + _aimed(edges[i - 1], wanted[i - 1] - before, length), wanted[i])
        # A distance changes by little more than the vertex moves: most need not be measured again.
        known = np.where(np.isinf(distance[i]), UNSEEN, distance[i])
        near = np.flatnonzero((known - 1.2 * _size(end - wanted[i]) < keep[i]) & (first <= i))
        depth, out = distance[i].copy(), way[i].copy()
        distance[i, moved] = np.inf
        least = np.minimum(distance[i - 1], 0) - 1.1 * length - STEEP
        for tried in range(TRIES):
            again = near[moved[near]]
            if len(again):
                height, up = body.distance(np.ascontiguousarray(end[:, again].T, np.float32))
                distance[i, again], way[i][:, again] = height, up.T
            along = end[:, near] - before[:, near]
            odd = near[np.isinf(distance[i, near]) | (distance[i, near] < least[near])]
            if len(odd):
                distance[i, odd], way[i][:, odd] = _supposed(
                    [(distance[i - 1, odd], way[i - 1][:, odd], end[:, odd] - before[:, odd]),
                     (np.where(depth[odd] < least[odd], 0, depth[odd]), out[:, odd], end[:, odd] - wanted[i][:, odd])]
                )  # fmt: skip
            low = distance[i, near] < keep[i, near] - (0.1 * MARGIN if tried else SLACK)
            near, along = near[low], along[:, low]
            if not len(near):
                break
            moved[near] = True
            up = way[i][:, near]
            lack = keep[i, near] + 4e-5 - distance[i, near]
            tilted, gained = _tilted(along, up, lack, length[near])
            end[:, near] = before[:, near] + tilted
            distance[i, near] += gained
            near = near[(_size(tilted - along) > FLAT) | (gained < lack - 1e-6)]
        else:
            hard[near] = True
        result[i] = end
    return result, np.flatnonzero(hard)


def _supposed(planes: list[tuple]) -> tuple[np.ndarray, np.ndarray]:
    """Distance (n,) and direction (3, n) where none is known, or the known one is too deep to be true.

    The plane of the vertex before also holds there if that vertex lies on the skin or below it, and so does the plane of the
    wanted place if that is inside; of the two, the nearer plane is the way out.

    Args:
        planes: of the vertex before and of the wanted place, distance (n,), its direction (3, n) and the way from there (3, n).
    """
    (first, up, step), (second, other, far) = planes
    height = np.where(first < 2 * MARGIN, first + dot_apart(up, step), np.inf)
    nearer = np.where(second < 0, second + dot_apart(other, far), -np.inf)
    return np.maximum(height, nearer), np.where(nearer > height, other, up)


def _aimed(edge: np.ndarray, off: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Wanted segments (3, n) [m], bent back a little for vertices that lie `off` (3, n) from their wanted places.

    By less than a segment: strands turn towards their wanted places, and never turn round on the way.
    """
    most = BACK * length
    aim = edge + off * (most / np.sqrt(dot_apart(off, off) + most**2 + 1e-30))
    aim *= length / np.maximum(_size(aim), 1e-12)
    return aim


def _tilted(along: np.ndarray, up: np.ndarray, lack: np.ndarray, length: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Segments (3, n) turned just enough to lift their ends by `lack` (n,) [m] along `up` (3, n), and by how much it does.

    They point straight away from the body if even that is not enough.
    """
    rise = dot_apart(along, up)
    slope = np.clip(rise + lack, -length, length)
    # A billionth sideways: a segment that goes straight down has to fall to some side.
    side = along - rise * up + 1e-9 * up[[1, 2, 0]]
    side -= dot_apart(side, up) * up
    side *= np.sqrt(length**2 - slope**2) / np.maximum(_size(side), 1e-30)
    return side + slope * up, slope - rise


def _size(a: np.ndarray) -> np.ndarray:
    return np.sqrt(dot_apart(a, a))
