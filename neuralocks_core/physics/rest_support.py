# SPDX-License-Identifier: Apache-2.0
"""The force that makes a groom's rest shape an equilibrium."""

from __future__ import annotations

import torch
from torch import Tensor

from neuralocks_core.motion import G


def rest_support(rest: Tensor, mass: Tensor) -> Tensor:
    """The part of each vertex's own weight that tension along the strand cannot carry.

    A groom is modelled with gravity already in it, so the paper's stress-free rest shape would droop a second
    time. Counting the tension from tip to root, `T_i = max(0, (T_{i+1} e_{i+1} + m g) . e_i)`, the support is
    `T_i e_i - T_{i+1} e_{i+1} - m g`: nothing for hair that hangs straight, the whole weight for hair that
    stands. Source: docs/architecture.md; the paper's choice is to have none.

    Args:
        rest: (..., S, K, 3) canonical points [m].
        mass: (..., S, K) [m], per unit line density.

    Returns:
        (..., S, K, 3) force per unit line density, fixed in head axes [m^2/s^2]; the root's is zero.
    """
    edge = rest.diff(dim=-2)
    edge = edge / edge.square().sum(-1, keepdim=True).clamp_min(1e-18).sqrt()
    down = torch.zeros_like(rest[..., 0, :])
    down[..., 1] = -G
    pull = torch.zeros_like(down)
    support = []
    for i in range(rest.shape[-2] - 1, 0, -1):
        load = pull + mass[..., i, None] * down
        along = edge[..., i - 1, :]
        carried = (load * along).sum(-1, keepdim=True).clamp_min(0.0) * along
        support.append(carried - load)
        pull = carried
    support.append(torch.zeros_like(down))
    return torch.stack(support[::-1], dim=-2)
