# SPDX-License-Identifier: GPL-3.0-or-later
"""Boundary vectors of a clip: those at its own samples, which playing and scrubbing need, are computed in blocks and kept."""

import numpy as np

from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.wind import Wind

BLOCK = 8
"""Samples made together: each then costs a third of one made alone, and the frame that makes them is hardly slower."""


class SampledBoundary:
    """What a network reads of the body, bit for bit as from `BoundarySampler.vectors`.

    Args:
        sampler: of the character in its clip.
    """

    def __init__(self, sampler: BoundarySampler):
        self._sampler, self._clip = sampler, sampler.clip
        self._look: tuple = ()
        self._blocks: dict[int, np.ndarray] = {}

    def vector(
        self, time: float, material: np.ndarray, strength: float, joints: np.ndarray, wind: Wind | None = None
    ) -> np.ndarray:
        """The vector (size,) at a time [s], with the world joints (J, 4, 4) that are drawn there."""
        clip = self._clip
        row = int(np.searchsorted(clip.times, time - 1e-9))
        sampled = row < len(clip.times) and abs(clip.times[row] - time) < 1e-9
        if not sampled or not np.array_equal(joints, clip.joints[row]):
            return self._sampler.vectors([time], material, strength, joints[None], wind)[0]
        look = *material, strength, wind
        if look != self._look:
            self._look, self._blocks = look, {}
        first = row - row % BLOCK
        if first not in self._blocks:
            rows = slice(first, first + BLOCK)
            self._blocks[first] = self._sampler.vectors(clip.times[rows], material, strength, clip.joints[rows], wind)
        return self._blocks[first][row - first]
