# SPDX-License-Identifier: Apache-2.0
"""A groom as the network sees it: 24 vertices per strand, canonical space, scalp frames."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from neuralocks_core.groom import Groom
from neuralocks_core.models.network_sizes import K
from neuralocks_core.strands.arclength import resample
from neuralocks_core.strands.centreline import centre_lines
from neuralocks_core.strands.locks import lock_of_roots

if TYPE_CHECKING:
    from neuralocks_core.character import Character

CLAMPED = 2
"""Number of a strand's K vertices, at the root, that never move relative to the head."""

PLACEHOLDER_LENGTH = 0.01
"""Length [m] of the straight strand that stands in for one that has no two distinct points."""

SHORTEST_EDGE = 1e-7
"""A strand with a shorter edge [m] between the network's vertices has no direction there, and does not move."""

EACH = ("rest", "valid", "uv", "root_frame", "lock", "length")
"""Fields of a StrandSet with one value for each strand; the others are the head's."""


@dataclass(frozen=True, eq=False)
class StrandSet:
    """A groom as inference and training read it; see `strands_on`."""

    rest: np.ndarray
    """(S, K, 3) float32 [m], canonical space, uniform in arc length of the author's strand; for curls finer than that,
    the line they wind around (`centreline`)."""
    valid: np.ndarray
    """(S,) bool, false where the groom's strand has no two distinct points, or doubles back so exactly that two of the K vertices lie in
    one place; its other values are placeholders."""
    uv: np.ndarray
    """(S, 2) float32 in [0, 1], direction of the root seen from the head's centre."""
    root_frame: np.ndarray
    """(S, 3, 3) float32, rotation from canonical to scalp axes (rows are the scalp axes; +Y leaves the head)."""
    lock: np.ndarray
    """(S,) int32, which lock each strand belongs to; numbered without gaps from 0."""
    length: np.ndarray
    """(S,) float32 [m], length of the K-vertex polyline."""
    head_origin: np.ndarray
    """(3,) float64 [m], bind-world position of the head joint, the origin of canonical space."""
    head_centre: np.ndarray
    """(3,) float64 [m], middle of the skull in canonical space."""
    facing: np.ndarray
    """(3, 3) float64, rotation from bind-world to canonical axes."""

    @property
    def root_normal(self) -> np.ndarray:
        """(S, 3) float32, canonical unit vector out of the head at the root: the scalp frame's second axis."""
        return self.root_frame[:, 1]

    def subset(self, strands: np.ndarray) -> StrandSet:
        """Only the given strands ((N,) indices or (S,) mask). Lock numbers stay as they are."""
        return replace(self, **{name: getattr(self, name)[strands] for name in EACH})

    def whole_locks(self, count: int, seed: int = 0) -> np.ndarray:
        """Indices of at most `count` valid strands, in whole locks except the last; the locks are chosen at random over the
        scalp, always the same ones. With one seed, those of a smaller count are among those of a larger one.
        """
        usable = np.flatnonzero(self.valid)
        if len(usable) <= count:
            return usable
        order = np.random.default_rng(seed).permutation(int(self.lock.max()) + 1)
        rank = np.empty(len(order), int)
        rank[order] = np.arange(len(order))
        by_lock = usable[np.argsort(rank[self.lock[usable]], kind="stable")]
        return np.sort(by_lock[:count])

    def carried(self, offset: np.ndarray) -> StrandSet:
        """The same strands, each moved as a whole by `offset` (S, 1, 3) [m], canonical; a network's inputs do not change."""
        return replace(self, rest=self.rest + offset)

    @classmethod
    def joined(cls, sets: list[StrandSet]) -> StrandSet:
        """Strand sets of one head, one after another; each keeps its own locks."""
        if len(sets) == 1:
            return sets[0]
        values = {name: np.concatenate([getattr(each, name) for each in sets]) for name in EACH}
        before = np.cumsum([0, *(each.lock.max(initial=-1) + 1 for each in sets[:-1])])
        lock = np.concatenate([each.lock + first for each, first in zip(sets, before)])
        return replace(sets[0], **values | {"lock": lock.astype(np.int32)})


def strands_on(character: Character, groom: Groom) -> StrandSet:
    """The groom as the network sees it on a character's head: `strand_set` with the position of that head.

    Args:
        character: whose head carries the hair.
        groom: in bind-world metres.
    """
    origin = character.canonical_to_bind[:3, 3]
    return strand_set(groom, origin, character.head_centre, character.facing)


def strand_set(
    groom: Groom,
    head_origin: np.ndarray,
    head_centre: np.ndarray,
    facing: np.ndarray | None = None,
) -> StrandSet:
    """The groom resampled to K vertices per strand, with the other inputs of the network.

    Args:
        groom: in bind-world metres.
        head_origin: (3,) [m], bind-world position of the head joint.
        head_centre: (3,) [m], middle of the skull in canonical space.
        facing: (3, 3) rotation from bind-world axes to canonical axes (Y up, +Z face); identity if left out.
    """
    facing = np.eye(3) if facing is None else np.asarray(facing, dtype=np.float64)
    head_origin = np.asarray(head_origin, dtype=np.float64)
    head_centre = np.asarray(head_centre, dtype=np.float64)

    sampled, valid = resample(groom, K)
    sampled[valid] = centre_lines(sampled[valid])
    # Where a strand goes back on itself, two vertices may lie in one place.
    valid &= np.linalg.norm(np.diff(sampled, axis=1), axis=2).min(axis=1) > SHORTEST_EDGE
    rest = (sampled - head_origin) @ facing.T
    rest[groom.counts == 0] = head_centre + [0.0, 0.1, 0.0]
    normal = _root_normals(rest[:, 0], head_centre)
    steps = np.linspace(0.0, PLACEHOLDER_LENGTH, K)[:, None]
    rest[~valid] = rest[~valid, :1] + steps * normal[~valid, None]

    return StrandSet(
        rest=rest.astype(np.float32),
        valid=valid,
        uv=root_uv(rest[:, 0], head_centre),
        root_frame=root_frames(normal).astype(np.float32),
        lock=lock_of_roots(rest[:, 0]),
        length=np.linalg.norm(np.diff(rest, axis=1), axis=2).sum(axis=1).astype(np.float32),
        head_origin=head_origin,
        head_centre=head_centre,
        facing=facing,
    )


def scalp_local(strands: StrandSet) -> np.ndarray:
    """(S, K, 3) float32 [m]: root-relative points in scalp axes, the encoder's input (paper, section 3.2)."""
    relative = strands.rest - strands.rest[:, :1]
    return np.matmul(relative, strands.root_frame.transpose(0, 2, 1))


def root_uv(roots: np.ndarray, head_centre: np.ndarray) -> np.ndarray:
    """(S, 2) float32 in [0, 1]: Lambert's equal-area azimuthal map of the root's direction, its pole at the crown.

    It does not depend on a mesh's own UVs, so one network works for any head. Singular only straight down, inside the neck.

    Args:
        roots: (S, 3) [m] in canonical space.
        head_centre: (3,) [m] in canonical space.
    """
    normal = _root_normals(roots, head_centre)
    flat = normal[:, [0, 2]]
    across = np.linalg.norm(flat, axis=1, keepdims=True)
    radius = np.sqrt(np.maximum(1.0 - normal[:, 1:2], 0.0) / 2.0)  # 0 at the crown, 1 straight down
    return (0.5 + 0.5 * radius * flat / np.maximum(across, 1e-12)).astype(np.float32)


def root_frames(normal: np.ndarray) -> np.ndarray:
    """(S, 3, 3) smallest rotations that take the unit vectors `normal` (S, 3) to +Y; a half turn about X for
    -Y."""
    x, y, z = normal.T
    # Rodrigues' formula for the axis n x Y; written out, it needs no trigonometry and one division.
    turn = 1.0 / np.maximum(1.0 + y, 1e-12)
    frames = np.stack(
        [1.0 - x * x * turn, -x, -x * z * turn, x, y, z, -x * z * turn, -z, 1.0 - z * z * turn], axis=1
    ).reshape(-1, 3, 3)
    frames[y < -1.0 + 1e-9] = np.diag([1.0, -1.0, -1.0])
    return frames


def _root_normals(roots: np.ndarray, head_centre: np.ndarray) -> np.ndarray:
    """(S, 3) unit vectors from the head's centre to the roots; +Y for a root at the centre."""
    outward = np.asarray(roots, dtype=np.float64) - head_centre
    distance = np.linalg.norm(outward, axis=1, keepdims=True)
    outward[distance[:, 0] < 1e-9] = [0.0, 1.0, 0.0]
    return outward / np.where(distance < 1e-9, 1.0, distance)
