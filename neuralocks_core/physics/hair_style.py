# SPDX-License-Identifier: Apache-2.0
"""Preservation of tied styles near the head (paper section 3.4.4, equation 7)."""

from __future__ import annotations

from torch import Tensor

from neuralocks_core.physics.rods import Rods

STIFFNESS = 2500.0
"""[1/s^2], for tied styles; others have none."""
REACH = 0.03
"""s_max [m]."""


def hair_style(x: Tensor, rods: Rods, distance: Tensor, stiffness: float | Tensor = STIFFNESS) -> Tensor:
    """Energy `k sum m (1 - min(1, s / s_max)) |x - x_posed|^2`.

    Weighted by vertex mass, which the paper's sum is not, so that it does not depend on the number of vertices.

    Args:
        x: (..., S, K, 3) points in canonical space, where the posed groom is the rest shape [m].
        rods: the strands at rest.
        distance: (..., S, K) s, distance of each vertex to the body [m]; no gradient goes through it; otherwise hair
            would flee from the body to escape its style.
        stiffness: [1/s^2], a number or (..., S, 1).

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    hold = 1.0 - (distance.detach().clamp_min(0.0) / REACH).clamp_max(1.0)
    return (stiffness * rods.mass * hold * (x - rods.rest).square().sum(-1)).sum(-1)
