# SPDX-License-Identifier: Apache-2.0
"""Clumping at inference: how far the hairs of a lock stray from the motion of their lock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from neuralocks_core.materials import Material, constants
from neuralocks_core.models.network_sizes import SHAPE, K
from neuralocks_core.motion import GRAVITY
from neuralocks_core.strands.locks import lock_mates, lock_means, tied_together
from neuralocks_core.strands.strand_set import CLAMPED, StrandSet

CANTILEVER = 12.36
"""Fourth power of 1.8751, the first root of a clamped rod's cos cosh = -1."""


@dataclass(frozen=True, eq=False)
class Locks:
    """The parts of a groom's locks that ties join, and how far their hairs stray from the motion that they share.

    The network knows what a hair and its lock look like, but not where its neighbours are, so it learns nothing about ties
    between them. Therefore hairs are drawn towards the mean motion of their lock, or released from it, afterwards. Ties pull
    hairs towards each other, so they do not move a lock as a whole. At the default, nothing is computed.
    """

    rest: np.ndarray
    """The hairs' (S, 24, 3) rest points [m]."""
    valid: np.ndarray
    """(S,) bool, hairs that count."""
    lock: np.ndarray
    """(S,) each hair's lock. Hairs that no tie joins to others are locks of their own."""
    rod: np.ndarray
    """(S,) how firmly bending stiffness holds each hair, as a clamped rod: 12.36 / L^4 [1/m^4]."""
    pendulum: np.ndarray
    """(S,) how firmly its weight holds it, as a pendulum: g / L [1/s^2]."""
    tie: np.ndarray
    """(S,) how firmly ties hold a hair in its lock, relative to one tied to the lock's mean; see `_tie`."""

    @classmethod
    def of(cls, strands: StrandSet) -> Locks:
        """The locks of a groom."""
        mates = lock_mates(strands.rest, strands.lock)
        own = tied_together(mates)
        means = lock_means(strands.rest.reshape(len(own), -1), own, strands.valid).reshape(-1, K, 3)
        length = np.maximum(strands.length.astype(np.float64), 1e-3)
        return cls(
            strands.rest,
            strands.valid,
            own,
            CANTILEVER / np.square(np.square(length)),
            -GRAVITY[1] / length,
            _tie(strands.rest, mates, own, means),
        )

    def spread(self, log_ratios: np.ndarray) -> np.ndarray:
        """Factors on how far hairs stray from their lock: 1 for the default clumping, less for more clumping.

        Whatever drives a hair away from its lock works against its own stiffness k0 and its ties, 2 k in the solver's energy
        k |x - mean of neighbours|^2 per mass. So it strays by the drive over k0 + 2 k t, with k0 = 12.36 B / L^4 + w g / L and its
        `tie` t: ties hardly act on short hair, and are most of what holds long hair. `benchmarks/materials.py` compares this with
        the solver.

        Args:
            log_ratios: of the material (4,), as a boundary vector holds it.

        Returns:
            (S,) float32.
        """
        bend, weight, _, clumping = constants(log_ratios)
        own = weight * (bend * self.rod + self.pendulum)  # the vector's bend is B / w
        return ((own + 2 * self.tie * Material().clumping) / (own + 2 * self.tie * clumping)).astype(np.float32)

    def gather(self, displacement: np.ndarray, log_ratios: np.ndarray) -> Callable[[slice], np.ndarray]:
        """Change how far hairs stray from their locks. Each edge keeps the length that the network gave it: its rest length, unless
        the model outputs displacements, which may stretch hair.

        Args:
            displacement: of all hairs (S, 72) float32 [m].
            log_ratios: of the material (4,), as a boundary vector holds it.

        Returns:
            A function from some hairs to their changed displacement (n, 72) float32 [m].
        """
        led = lock_means(displacement, self.lock, self.valid).reshape(-1, K, 3)
        factor = self.spread(log_ratios)

        def gathered(hairs: slice) -> np.ndarray:
            moved = displacement[hairs].reshape(-1, K, 3)
            way = led[self.lock[hairs]]
            edges = np.diff(self.rest[hairs], axis=1)
            own = edges + np.diff(moved, axis=1)
            wanted = edges + np.diff(way + factor[hairs, None, None] * (moved - way), axis=1)
            length, size = (np.sqrt(np.square(each).sum(-1, keepdims=True)) for each in (own, wanted))
            change = (wanted * (length / np.maximum(size, 1e-12)) - edges)[:, CLAMPED - 1 :]
            result = np.zeros_like(moved)
            np.cumsum(change, axis=1, out=result[:, CLAMPED:])
            return result.reshape(-1, SHAPE)

        return gathered


def _tie(rest: np.ndarray, mates: np.ndarray, lock: np.ndarray, means: np.ndarray) -> np.ndarray:
    """How firmly ties hold the hairs of each lock (S,): about 1 where each is tied to all others, 0 where one is alone.

    Ties join nearest neighbours, so a wide lock resists little when its hairs spread evenly from one side to the other, but as
    much as any other lock when one hair parts from the next. Hair does both: the result is the geometric mean of 1 and the
    Rayleigh quotient of the ties for the field of the hairs' offsets at rest.

    Args:
        rest: (S, 24, 3) [m].
        mates: (S, M) int, see `lock_mates`.
        lock: (S,) of each hair; means: of each lock (L, 24, 3) [m].
    """
    apart = (rest - means[lock]).reshape(len(rest), -1)
    tied, count = mates >= 0, len(means)
    pulled = np.zeros_like(apart)
    for column, there in zip(mates.T, tied.T):
        pulled[there] += apart[there] - apart[column[there]]
    pulled /= np.maximum(tied.sum(axis=1), 1)[:, None]
    work, size = (np.bincount(lock, (apart * each).sum(axis=1), count) for each in (pulled, apart))
    return np.sqrt(np.maximum(work, 0) / np.maximum(size, 1e-12))[lock]
