# SPDX-License-Identifier: Apache-2.0
"""Clumping in inference: how far the hairs of a lock part from the way of their lock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from neuralocks_core.locks import lock_means
from neuralocks_core.materials import RANGES
from neuralocks_core.strands import K, StrandSet, root_frames

COLUMN = list(RANGES).index("clumping")
"""Where clumping lies among a vector's material."""
SPREAD = 0.85
"""How fast hairs part as ties get weaker. With this, free hair that is shaken parts by the same ratios as the solver's
(`benchmarks/materials.py --groom library`), whose hairs stray by about the inverse root of the ties' stiffness (counted
from 20 /s^2, see `Material.log_ratios`), as a spring does in a random drive; kept lengths take a part of what is asked
for."""


def spread(log_ratio: float) -> float:
    """Factor on how far hairs stray from their lock, for the logarithm of the clumping's ratio to its default."""
    return float(np.exp(-SPREAD * log_ratio))


@dataclass(frozen=True, eq=False)
class Locks:
    """The locks of a groom as strands of their own, and the way from their motion to that of their hairs.

    The network knows of a hair what it and its lock look like, not where its neighbours are, and learns nothing of
    ties between them. So it is asked for the locks' own strands too, in each frame, and hairs are drawn to where their
    lock goes, or let loose from it. Nothing is done, and nothing computed, at the default.
    """

    strands: StrandSet
    """A strand for each lock: the mean of its hairs."""
    rest: np.ndarray
    """The hairs' (S, 24, 3) rest points [m]."""
    lock: np.ndarray
    """(S,) each hair's lock."""

    @classmethod
    def of(cls, strands: StrandSet) -> Locks:
        """The locks of a groom; hairs that are no strands do not count."""
        count = len(strands.rest)
        flat = np.concatenate([strands.rest.reshape(count, -1), strands.uv, strands.root_normal], axis=1)
        means = lock_means(flat, strands.lock, strands.valid)
        rest, uv, normal = means[:, : 3 * K].reshape(-1, K, 3), means[:, 3 * K : -3], means[:, -3:]
        normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        lock = StrandSet(
            rest=rest,
            valid=np.ones(len(means), bool),
            uv=uv,
            root_frame=root_frames(normal).astype(np.float32),
            lock=np.arange(len(means), dtype=np.int32),
            length=np.linalg.norm(np.diff(rest, axis=1), axis=2).sum(axis=1),
            head_origin=strands.head_origin,
            head_centre=strands.head_centre,
            facing=strands.facing,
        )
        return cls(lock, strands.rest, strands.lock)

    def gather(self, displacement: np.ndarray, hairs: slice, led: np.ndarray, factor: float) -> None:
        """Change how far hairs stray from their locks, every length kept.

        Args:
            displacement: of these hairs (n, 72) float32 [m], changed in place.
            hairs: which.
            led: displacement of all locks (L, 24, 3) [m].
            factor: on the distance between a hair's displacement and its lock's.
        """
        rest = self.rest[hairs]
        moved = displacement.reshape(rest.shape)
        way = led[self.lock[hairs]]
        edges = np.diff(rest, axis=1)
        length = np.sqrt(np.square(edges).sum(-1, keepdims=True))
        wanted = edges + np.diff(way + np.float32(factor) * (moved - way), axis=1)
        size = np.sqrt(np.square(wanted).sum(-1, keepdims=True))
        change = (wanted * (length / np.maximum(size, 1e-12)) - edges)[:, 1:]
        moved[:, :2] = 0
        np.cumsum(change, axis=1, out=moved[:, 2:])
