# SPDX-License-Identifier: GPL-3.0-or-later
"""The wind of a character: as the panel has it, as a bake takes it, and as the core does."""

import math
from typing import NamedTuple

from neuralocks_core.wind import Wind

from ..rigs.axes import to_core


class Blowing(NamedTuple):
    """A wind in Blender's world axes, as `usd.baking.bake` takes it; without arguments, a calm.

    Attributes:
        wind: acceleration of hair (3,) [m/s^2].
        gusts: share of it by which it varies.
    """

    wind: tuple[float, float, float] | None = None
    gusts: float | None = None

    @classmethod
    def of(cls, strength: float, direction: float, gusts: float) -> "Blowing":
        """A level wind of this strength [m/s^2] towards a direction [rad from +X to +Y]. Its numbers are rounded, so that a bake made
        elsewhere with those that a bake records is the same.
        """
        level = (strength * math.cos(direction), strength * math.sin(direction), 0.0)
        x, y, z = (round(each, 6) for each in level)
        return cls((x, y, z), round(gusts, 6)) if x or y else cls()

    def in_core(self) -> Wind | None:
        """The same in the core's axes; None for a calm."""
        return self.wind and Wind(tuple(to_core()[:3, :3] @ self.wind), self.gusts)
