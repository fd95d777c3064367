# SPDX-License-Identifier: GPL-3.0-or-later
"""The wind of a character: as the panel has it, as a bake takes it, and as the core does."""

import math
from typing import NamedTuple

from neuralocks_core.wind import Wind

from .axes import to_core


class Blowing(NamedTuple):
    """A wind in Blender's world axes, as `usd.baking.bake` takes it.

    Attributes:
        wind: acceleration of hair (3,) [m/s^2].
        gusts: share of it by which it varies.
    """

    wind: tuple[float, float, float]
    gusts: float

    @classmethod
    def of(cls, strength: float, direction: float, gusts: float) -> "Blowing | None":
        """A level wind of this strength [m/s^2] towards a direction [rad from +X to +Y]; None for a calm. Its numbers are rounded, so
        that a bake made elsewhere with those that a bake records is the same.
        """
        level = (strength * math.cos(direction), strength * math.sin(direction), 0.0)
        x, y, z = (round(each, 6) for each in level)
        return cls((x, y, z), round(gusts, 6)) if x or y else None

    def in_core(self) -> Wind:
        """The same in the core's axes."""
        return Wind(tuple(to_core()[:3, :3] @ self.wind), self.gusts)
