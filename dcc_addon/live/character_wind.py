# SPDX-License-Identifier: GPL-3.0-or-later
"""The wind that blows on a character's hair, strands and bones alike, read from its settings."""

from ..services.hair.wind import Blowing


def blowing(armature) -> Blowing:
    """The wind as a bake takes it."""
    own = armature.neuralocks_character
    return Blowing.of(own.wind, own.wind_direction, own.gusts)
