# SPDX-License-Identifier: Apache-2.0
"""Weight (paper section 3.4.3, equation 6) and the force that holds the rest shape against it."""

from __future__ import annotations

from torch import Tensor

from neuralocks_core.physics.rods import Rods


def gravity(x: Tensor, rods: Rods, direction: Tensor, weight: float | Tensor = 1.0) -> Tensor:
    """Energy `sum -(m g + support)^T (x - x_rest)`.

    Measured from the rest shape, so that it is zero there; the paper's differs by a constant. The support is zero
    unless the rods have one.

    Args:
        x: (..., S, K, 3) points in canonical space [m].
        rods: the strands at rest.
        direction: (..., 3) gravity in the same axes, that is `R_head^T g` [m/s^2]; dimensions before the last are those
            of x before S.
        weight: factor on both, a number or (..., S, 1).

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    force = rods.mass[..., None] * direction[..., None, None, :] + rods.support
    return -(weight * (force * (x - rods.rest)).sum(-1)).sum(-1)
