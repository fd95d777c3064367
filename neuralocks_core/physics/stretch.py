# SPDX-License-Identifier: Apache-2.0
"""Resistance of edges to stretch (paper section 3.4.1, equation 2)."""

from __future__ import annotations

from torch import Tensor

from neuralocks_core.materials import STRETCH
from neuralocks_core.physics.rods import Rods


def stretch(x: Tensor, rods: Rods, stiffness: float | Tensor = STRETCH, *, per_edge: bool = False) -> Tensor:
    """Energy `k/2 sum l0 ((l - l0) / l0)^2`.

    The paper's `k/2 sum (l - l0)^2` depends on how many edges a strand is cut into; select it with `per_edge`;
    k is then in [m/s^2].

    Args:
        x: (..., S, K, 3) points [m].
        rods: the strands at rest.
        stiffness: [m^2/s^2], a number or (..., S, 1).
        per_edge: the paper's form.

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    length = x.diff(dim=-2).square().sum(-1).clamp_min(1e-18).sqrt()
    energy = (length - rods.length).square()
    if not per_edge:
        energy = energy / rods.length
    return (0.5 * stiffness * energy).sum(-1)
