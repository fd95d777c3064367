# SPDX-License-Identifier: Apache-2.0
"""Hair keeps its volume: a density that may not rise (paper section 3.4.2, equation 5)."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from neuralocks_core.materials import SMOOTHING
from neuralocks_core.physics.rods import Rods

STIFFNESS = 0.3
"""[m^2/s^2], on relative density."""


def self_collision(
    x: Tensor,
    rods: Rods,
    rest_density: Tensor,
    stiffness: float | Tensor = STIFFNESS,
    *,
    relative: bool = True,
) -> Tensor:
    """Energy `k sum m max(rho / rho_rest - 1, 0)^3`.

    The paper's `max(rho - rho_rest, 0)^3` has a constant that changes with the number of strands; it is taken with
    `relative=False`, and then k is in [m^8/s^2]. The rest density is each vertex's own, measured on the groom, or
    the groom's own locks would be pressure.

    Args:
        x: (..., S, K, 3) points [m].
        rods: the strands at rest.
        rest_density: (S, K) `density` of the same strands at rest [1/m^2].
        stiffness: [m^2/s^2], a number or (..., S, 1).
        relative: see above.

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    rise = density(x, rods.mass) - rest_density
    if relative:
        rise = rise / rest_density.clamp_min(1e-12)
    return (stiffness * rods.mass * torch.relu(rise) ** 3).sum(-1)


def density(x: Tensor, mass: Tensor) -> Tensor:
    """`rho_i = sum_j m_j W(|x_i - x_j|)`, each vertex itself included; W's smoothing length is `SMOOTHING`.

    Args:
        x: (..., S, K, 3) points [m].
        mass: (..., S, K) [m], per unit line density.

    Returns:
        (..., S, K) density per unit line density [1/m^2].
    """
    flat = x.flatten(-3, -2)
    square = (flat[..., :, None, :] - flat[..., None, :, :]).square().sum(-1)
    # The root of zero has no gradient; a vertex and itself have none to give.
    distance = square.clamp_min(1e-16).sqrt()
    masses = mass.flatten(-2, -1)[..., None, :]
    return (masses * kernel(distance, SMOOTHING)).sum(-1).reshape(x.shape[:-1])


def kernel(distance: Tensor, smoothing: float) -> Tensor:
    """Monaghan's M4 cubic spline W [1/m^3] at a distance [m], as Bando and others use it; zero from 2 h on."""
    s = distance / smoothing
    near, far = (1.0 - s).clamp_min(0.0), (2.0 - s).clamp_min(0.0)
    return (far**3 - 4.0 * near**3) / (4.0 * math.pi * smoothing**3)
