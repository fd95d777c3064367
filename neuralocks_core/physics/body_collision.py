# SPDX-License-Identifier: Apache-2.0
"""Hair stays out of the body (paper section 3.4.2, equation 4)."""

from __future__ import annotations

import torch
from torch import Tensor

from neuralocks_core.materials import COLLISION, LINEAR, MARGIN
from neuralocks_core.physics.rods import Rods
from neuralocks_core.strands.strand_set import CLAMPED


def body_collision(
    x: Tensor, rods: Rods, planes: Tensor, stiffness: float | Tensor = COLLISION, margin: float | Tensor = MARGIN
) -> Tensor:
    """Energy `k sum m max(D - d(x), 0)^3`, its depth linear beyond `LINEAR`: so deep vertices of an untrained
    network do not drown the rest.

    Weighted by vertex mass, which the paper's sum is not. The clamped vertices do not count: they are on the
    scalp.

    Args:
        x: (..., S, K, 3) points [m].
        rods: the strands at rest.
        planes: (..., S, K, 4) outward normal n and offset o of the nearest body element in the same space,
            `d = n . x - o`; found once for the penalised state.
        stiffness: k [1/(m s^2)], a number or (..., S, 1).
        margin: D [m], a number or (..., S, K): never more than a vertex has at rest.

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    depth = margin - ((planes[..., :3] * x).sum(-1) - planes[..., 3])
    cubic = depth.clamp(0.0, LINEAR)
    energy = cubic**3 + 3.0 * LINEAR**2 * torch.relu(depth - LINEAR)
    return (stiffness * rods.mass * energy)[..., CLAMPED:].sum(-1)
