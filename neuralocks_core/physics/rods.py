# SPDX-License-Identifier: Apache-2.0
"""What the potentials need from a strand at rest: lengths, masses, edges and the force that supports it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from neuralocks_core.strands.rest_support import rest_force


@dataclass(frozen=True)
class Rods:
    """Constants of S strands with K vertices, all per unit line density; see `rods`.

    Attributes:
        rest: (..., S, K, 3) rest points in canonical space [m].
        length: (..., S, K-1) rest length of each edge [m].
        voronoi: (..., S, K-2) rest length that belongs to each inner vertex, half of both edges [m].
        mass: (..., S, K) half the adjacent rest lengths [m]: a mass per unit line density.
        support: (..., S, K, 3) force that holds the bind pose, fixed in head axes [m^2/s^2].
    """

    rest: Tensor
    length: Tensor
    voronoi: Tensor
    mass: Tensor
    support: Tensor


def rods(rest: Tensor, *, supported: bool = True) -> Rods:
    """Measure strands at rest.

    Args:
        rest: (..., S, K, 3) canonical points, root first [m].
        supported: whether the groom carries its own weight in the bind pose (docs/architecture.md, Physics);
            else it is stress free and droops, as in the paper.
    """
    edge = rest.diff(dim=-2)
    length = edge.square().sum(-1).clamp_min(1e-18).sqrt()
    padded = torch.nn.functional.pad(length, (1, 1))
    mass = 0.5 * (padded[..., 1:] + padded[..., :-1])
    voronoi = 0.5 * (length[..., 1:] + length[..., :-1])
    support = torch.zeros_like(rest)
    if supported:
        support = torch.from_numpy(rest_force((edge / length[..., None]).numpy(), mass.numpy()))
    return Rods(rest, length, voronoi, mass, support)
