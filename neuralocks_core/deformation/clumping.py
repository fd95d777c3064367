# SPDX-License-Identifier: Apache-2.0
"""Clumping in inference: how far the hairs of a lock stray from the motion of their lock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from neuralocks_core.materials import RANGES, Material, constants
from neuralocks_core.motion import GRAVITY
from neuralocks_core.strands.locks import lock_means
from neuralocks_core.strands.strand_set import K, StrandSet, root_frames

COLUMN = list(RANGES).index("clumping")
"""Where clumping lies among a vector's material."""
CANTILEVER = 12.36
"""Fourth power of 1.8751, the first root of a clamped rod's cos cosh = -1."""


@dataclass(frozen=True, eq=False)
class Locks:
    """The locks of a groom as strands of their own, and how their motion moves their hairs.

    The network knows what a hair and its lock look like, but not where its neighbours are, so it learns nothing of ties
    between them. In each frame it is therefore asked for the locks' own strands, too, and hairs are drawn to where their
    lock goes, or let loose from it. At the default nothing is computed.
    """

    strands: StrandSet
    """A strand for each lock: the mean of its hairs."""
    rest: np.ndarray
    """The hairs' (S, 24, 3) rest points [m]."""
    lock: np.ndarray
    """(S,) each hair's lock."""
    rod: np.ndarray
    """(S,) how firmly bending stiffness holds each hair, as a clamped rod: 12.36 / L^4 [1/m^4]."""
    pendulum: np.ndarray
    """(S,) how firmly its weight holds it, as a pendulum: g / L [1/s^2]."""

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
        length = np.maximum(strands.length.astype(np.float64), 1e-3)
        return cls(lock, strands.rest, strands.lock, CANTILEVER / np.square(np.square(length)), -GRAVITY[1] / length)

    def spread(self, log_ratios: np.ndarray) -> np.ndarray:
        """Factors on how far hairs stray from their lock: 1 for the default clumping, less for more of it.

        Whatever drives a hair out of its lock's way works against its own stiffness k0 and its ties, 2 k in the solver's
        energy k |x - mean of neighbours|^2 per mass. So it strays by the drive over k0 + 2 k, with k0 = 12.36 B / L^4 + w g / L:
        ties hardly act on short hair, and are most of what holds long hair. `benchmarks/materials.py` measures it beside
        the solver.

        Args:
            log_ratios: of the material (4,), see `Material.log_ratios`.

        Returns:
            (S,) float32.
        """
        bend, weight, _, clumping = constants(log_ratios)
        own = bend * self.rod + weight * self.pendulum
        return ((own + 2 * Material().clumping) / (own + 2 * clumping)).astype(np.float32)

    def gather(self, displacement: np.ndarray, hairs: slice, led: np.ndarray, factor: np.ndarray) -> None:
        """Change how far hairs stray from their locks, every length kept.

        Args:
            displacement: of these hairs (n, 72) float32 [m], changed in place.
            hairs: which.
            led: displacement of all locks (L, 24, 3) [m].
            factor: of all hairs (S,) float32, on the distance between a hair's displacement and its lock's (`spread`).
        """
        rest = self.rest[hairs]
        moved = displacement.reshape(rest.shape)
        way = led[self.lock[hairs]]
        edges = np.diff(rest, axis=1)
        length = np.sqrt(np.square(edges).sum(-1, keepdims=True))
        wanted = edges + np.diff(way + factor[hairs, None, None] * (moved - way), axis=1)
        size = np.sqrt(np.square(wanted).sum(-1, keepdims=True))
        change = (wanted * (length / np.maximum(size, 1e-12)) - edges)[:, 1:]
        moved[:, :2] = 0
        np.cumsum(change, axis=1, out=moved[:, 2:])
