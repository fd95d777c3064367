# SPDX-License-Identifier: Apache-2.0
"""Neighbouring strands hold on to each other (paper section 3.4.4, equation 8)."""

from __future__ import annotations

import torch
from torch import Tensor

from neuralocks_core.materials import Material
from neuralocks_core.physics.rods import Rods


def adhesion(
    x: Tensor,
    rods: Rods,
    neighbours: Tensor,
    stiffness: float | Tensor = Material.clumping,
    *,
    paper: bool = False,
) -> Tensor:
    """Energy `k sum m mean_n |(x - x_n) - (x0 - x0_n)|^2` over the neighbours at rest.

    The paper's `|x - x_n|^2` pulls neighbours into one point. Both forms are means over the existing neighbours, weighted by
    vertex mass. No gradient goes into the neighbours: each pair counts at both its vertices, so the force equals the
    reference solver's and not twice that; in the paper's form it is the energy's full gradient.

    Args:
        x: (..., S, K, 3) points in canonical space [m].
        rods: the strands at rest.
        neighbours: (..., S, K, N) indices into the S K vertices, -1 for none (`locks.neighbours`).
        stiffness: [1/s^2], a number or (..., S, 1).
        paper: measure from zero instead of the rest offset, with the full gradient.

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    present = neighbours >= 0
    index = neighbours.clamp_min(0).long().flatten(-3)
    from_rest = x if paper else x - rods.rest
    flat = (from_rest if paper else from_rest.detach()).flatten(-3, -2)
    index = index.reshape(*(1,) * (flat.ndim - 1 - index.ndim), *index.shape, 1)
    others = torch.take_along_dim(flat, index, -2).reshape(*x.shape[:-1], neighbours.shape[-1], 3)
    gap = (from_rest[..., None, :] - others).square().sum(-1) * present
    mean = gap.sum(-1) / present.sum(-1).clamp_min(1)
    return torch.sum(stiffness * rods.mass * mean, -1)
