# SPDX-License-Identifier: Apache-2.0
"""Resistance to bending and twisting: the improved Cosserat potential (paper section 3.4.1, equation 3)."""

from __future__ import annotations

from enum import Enum

import torch
from torch import Tensor

from neuralocks_core.materials import Material
from neuralocks_core.physics.rods import Rods
from neuralocks_core.physics.transport import conjugate, direct_frames, loop_frames, product, scan_frames


class Cosserat(Enum):
    """How edge orientations are found."""

    EXACT = "exact"
    """Parallel transport along every edge; as a loop on a CPU, else as a scan."""
    SCAN = "scan"
    """The same, always as a scan of few and large operations."""
    LOOP = "loop"
    """The same, always edge by edge."""
    DIRECT = "direct"
    """The paper's fast transport, straight from the root edge."""
    CONSTANT = "constant"
    """Quaffure's constant director: each edge is held to its own posed direction."""


def bend_twist(
    x: Tensor, rods: Rods, stiffness: float | Tensor = Material.bend, form: Cosserat = Cosserat.EXACT
) -> Tensor:
    """Energy `k/2 sum l |Omega|^2`, `Omega = 2/l (Im(conj(q_i) q_{i+1}) - Im(conj(q0_i) q0_{i+1}))`.

    l is the rest length that belongs to the vertex between the two edges. `EXACT` is the default, not the paper's
    `DIRECT`, because straight transport gives curls a twist that is not there and is singular where an edge
    points against the root edge. `CONSTANT` is `k/2 sum 1/l |e - e0|^2` over all edges after the first, in
    the same units; unlike the others it does not converge as strands are subdivided: twice the edges give four times the energy.

    Args:
        x: (..., S, K, 3) points in canonical space, where the clamped root edge does not turn [m].
        rods: the strands at rest.
        stiffness: [m^4/s^2], a number or (..., S, 1).
        form: see `Cosserat`.

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    if form is Cosserat.CONSTANT:
        gap = (unit_edges(x) - unit_edges(rods.rest))[..., 1:, :].square().sum(-1)
        return (0.5 * stiffness * gap / rods.voronoi).sum(-1)
    strain = bend_difference(x, rods.rest, form)
    return (2.0 * stiffness * strain.square().sum(-1) / rods.voronoi).sum(-1)


def bend_difference(x: Tensor, rest: Tensor, form: Cosserat = Cosserat.EXACT) -> Tensor:
    """`l/2 Omega`: how much each turn between edges differs from its rest value, (..., S, K-2, 3), without unit."""
    turns, rest_turns = _turns(x, form), _turns(rest, form)
    if form is Cosserat.DIRECT:
        # Straight transport may put the two on opposite sides of the double cover: take the nearer sign. Exact
        # transport never does, its scalar part is cos(angle / 2).
        same = (turns * rest_turns).sum(-1, keepdim=True) >= 0
        turns = torch.where(same, turns, -turns)
    return (turns - rest_turns)[..., 1:]


def unit_edges(x: Tensor) -> Tensor:
    """(..., K, 3) points -> (..., K-1, 3) directions; zero for edges of no length."""
    edges = x.diff(dim=-2)
    return edges / edges.square().sum(-1, keepdim=True).clamp_min(1e-18).sqrt()


def _turns(x: Tensor, form: Cosserat) -> Tensor:
    if form is Cosserat.EXACT:
        form = Cosserat.LOOP if x.device.type == "cpu" else Cosserat.SCAN
    transport = {Cosserat.SCAN: scan_frames, Cosserat.LOOP: loop_frames, Cosserat.DIRECT: direct_frames}[form]
    frames = transport(unit_edges(x))
    return product(conjugate(frames[..., :-1, :]), frames[..., 1:, :])
