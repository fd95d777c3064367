# SPDX-License-Identifier: GPL-3.0-or-later
"""The sliders of strands, in the panel's order: the only list of them."""

from dataclasses import asdict
from typing import NamedTuple

from neuralocks_core.materials import RANGES, Material


class Slider(NamedTuple):
    """A number that an artist moves, which is 1 for average hair.

    Attributes:
        name: of the setting; those of MATERIAL have the same names as in the core and on the command line.
        label, description: what the panel says.
        low, high: what can be typed in.
        shown: how far it can be dragged.
    """

    name: str
    label: str
    description: str
    low: float
    high: float
    shown: float


def _factor(name: str, label: str, description: str) -> Slider:
    """A constant of the material, as a factor on the average one."""
    average = asdict(Material())[name]
    low, high = (round(end / average, 6) for end in RANGES[name])
    return Slider(name, label, f"{description}, relative to average hair", low, high, high)


MATERIAL = (
    _factor("bend", "Stiffness", "How strongly strands keep their shape"),
    _factor("weight", "Weight", "How heavy the hair is"),
    _factor("damping", "Damping", "How fast a swing dies out"),
    _factor("clumping", "Clumping", "How strongly neighbouring strands stay together"),
)
MOTION = Slider(
    "motion",
    "Motion",
    "How much of the motion shows; at 0 the hair hangs as in a held pose; type up to 4 to exaggerate it",
    0.0,
    4.0,
    1.0,
)
SLIDERS = (*MATERIAL, MOTION)
