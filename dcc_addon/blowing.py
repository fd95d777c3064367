# SPDX-License-Identifier: GPL-3.0-or-later
"""The wind that blows on a character's hair, strands and bones alike, read from its settings."""

from neuralocks_core.wind import Wind

from .services.wind import Blowing


def blowing(armature) -> Blowing | None:
    """The wind as a bake takes it; None for a calm."""
    own = armature.neuralocks_character
    return Blowing.of(own.wind, own.wind_direction, own.gusts)


def in_core(armature) -> Wind | None:
    """The same in the core's axes."""
    found = blowing(armature)
    return found and found.in_core()
