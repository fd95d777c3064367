# SPDX-License-Identifier: GPL-3.0-or-later
"""The width at which strands of particle hair are drawn."""

import numpy as np

from neuralocks_core.groom import Groom
from neuralocks_core.strands.arclength import arc_lengths


def radii(groom: Groom, root: float, tip: float, shape: float, pointed: bool) -> np.ndarray:
    """Radius of each point (P,) float32, as Cycles draws particle hair.

    Args:
        groom: the strands, in any unit.
        root, tip: radius at both ends.
        shape: from -1 to 1; above 0 strands thin out early, below 0 late.
        pointed: strands end in a point.
    """
    arc, length = arc_lengths(groom)
    left = 1 - arc / np.maximum(np.repeat(length, groom.counts), 1e-12)
    power = 1 + shape if shape < 0 else 1 / max(1 - shape, 1e-3)
    found = np.clip(left, 0, 1) ** power * (root - tip) + tip
    if pointed:
        found[(groom.starts + groom.counts - 1)[groom.counts > 0]] = 0
    return found.astype(np.float32)
