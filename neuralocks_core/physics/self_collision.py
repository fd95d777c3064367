# SPDX-License-Identifier: Apache-2.0
"""Hair keeps its volume: a density that may not rise (paper section 3.4.2, equation 5)."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor
from torch.utils.checkpoint import checkpoint

from neuralocks_core.materials import SMOOTHING
from neuralocks_core.physics.rods import Rods

STIFFNESS = 0.3
"""[m^2/s^2], on relative density."""
FEW = 1536
"""Up to this many vertices (of 64 strands), all pairs are compared; above it, only near ones."""
PAIRS = 1_000_000
"""Pairs of vertices in memory at a time, about 0.3 kB each."""


def self_collision(
    x: Tensor,
    rods: Rods,
    rest_density: Tensor,
    stiffness: float | Tensor = STIFFNESS,
    *,
    relative: bool = True,
) -> Tensor:
    """Energy `k sum m max(rho / rho_rest - 1, 0)^3`.

    The paper's `max(rho - rho_rest, 0)^3` has a constant that changes with the number of strands; select it with
    `relative=False`, and then k is in [m^8/s^2]. The rest density is each vertex's own, measured on the groom; otherwise
    the groom's own locks would cause pressure.

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
    flat, masses = x.flatten(-3, -2), mass.expand(x.shape[:-1]).flatten(-2, -1)
    if flat.shape[-2] <= FEW:
        return _by_all(flat, masses).reshape(x.shape[:-1])
    each = zip(flat.reshape(-1, *flat.shape[-2:]), masses.reshape(-1, masses.shape[-1]))
    return torch.stack([by_near(points, m) for points, m in each]).reshape(x.shape[:-1])


def _by_all(points: Tensor, mass: Tensor) -> Tensor:
    """Densities (..., N) of points (..., N, 3) from all pairs at once, the fastest way for few points."""
    square = (points[..., :, None, :] - points[..., None, :, :]).square().sum(-1)
    return (mass[..., None, :] * kernel(_root(square), SMOOTHING)).sum(-1)


def by_near(points: Tensor, mass: Tensor) -> Tensor:
    """Densities (N,) of points (N, 3) from the pairs within the kernel's reach. The gradient searches them again, so that only
    about PAIRS are in memory at a time.
    """
    places = points.detach().cpu().double().numpy()
    everywhere = cKDTree(places)
    reach = 2.001 * SMOOTHING  # slightly too far: pairs that rounding lets in count nothing
    # Successive vertices of a strand have about the same number of near ones.
    near = np.repeat(everywhere.query_ball_point(places[::8], reach, return_length=True), 8)[: len(places)]
    starts = np.flatnonzero(np.diff(np.cumsum(near) // PAIRS, prepend=-1))

    def block(first: int, last: int, points: Tensor, mass: Tensor) -> Tensor:
        here = cKDTree(places[first:last])
        pairs = here.sparse_distance_matrix(everywhere, reach, output_type="ndarray")
        one, other = (torch.from_numpy(pairs[name].astype(np.int64)).to(points.device) for name in ("i", "j"))
        square = (points[first + one] - points[other]).square().sum(-1)
        return points.new_zeros(here.n).index_add(0, one, mass[other] * kernel(_root(square), SMOOTHING))

    once_more = partial(checkpoint, block, use_reentrant=False, preserve_rng_state=False)
    return torch.cat([once_more(*ends, points, mass) for ends in pairwise([*starts.tolist(), len(places)])])


def _root(square: Tensor) -> Tensor:
    """Distances; the root of zero has no gradient, and a vertex paired with itself needs none."""
    return square.clamp_min(1e-16).sqrt()


def kernel(distance: Tensor, smoothing: float) -> Tensor:
    """Monaghan's M4 cubic spline W [1/m^3] at a distance [m], as Bando and others use it; zero from 2 h on."""
    s = distance / smoothing
    near, far = (1.0 - s).clamp_min(0.0), (2.0 - s).clamp_min(0.0)
    return (far**3 - 4.0 * near**3) / (4.0 * math.pi * smoothing**3)
