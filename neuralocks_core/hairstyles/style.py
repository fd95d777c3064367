# SPDX-License-Identifier: Apache-2.0
"""What defines a hairstyle: where it grows, which way its strands go, and how they are shaped afterwards."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass

import numpy as np

from neuralocks_core.hairstyles.growth import Site
from neuralocks_core.hairstyles.obstacle import Obstacle
from neuralocks_core.hairstyles.scalp import Scalp
from neuralocks_core.hairstyles.shaping import Shape
from neuralocks_core.hairstyles.variation import Variation


@dataclass(frozen=True)
class Style(ABC):
    """A style: what it does to all strands, and where they grow."""

    shape: Shape
    _: KW_ONLY
    density: Callable[[np.ndarray], np.ndarray] | None = None
    """`Site.seen` (S, 3) -> probability (S,) 0..1 that hair grows there; None means everywhere."""
    zone: Callable[[np.ndarray], np.ndarray] | None = None
    """`Site.seen` (S, 3) -> zone numbers (S,): no clump reaches from one zone into another."""

    @abstractmethod
    def axis(self, site: Site, scalp: Scalp, obstacle: Obstacle) -> np.ndarray:
        """(S, K, 3) float32 [m]: strands from their roots, before they are waved or curled."""

    @abstractmethod
    def varied(self, variation: Variation) -> Style:
        """The style with a variation applied."""
