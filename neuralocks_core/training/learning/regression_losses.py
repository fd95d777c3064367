# SPDX-License-Identifier: Apache-2.0
"""The losses of a regression on rollouts."""

from __future__ import annotations

import torch
from torch import Tensor

from neuralocks_core.materials import MARGIN
from neuralocks_core.models.network_sizes import K
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.networks import StrandNet, deform

STILL = 0.01
"""Motion, in strand lengths, below which a strand counts as standing still."""
CREEP = 0.002
"""Motion from frame to frame, in strand lengths, below which a strand hardly moves."""
TOGETHER = 0.003
"""Distance, in strand lengths, below which the hairs of a lock count as one."""


def regression_losses(net: StrandNet, batch: dict[str, Tensor], options: RegressionOptions) -> dict[str, Tensor]:
    """Weighted losses of a batch, each a mean in units of strand length; `swing`, `settling` and `parting` are ratios.

    `position`: |x - x*|. `velocity`: the same for frame differences. `swing`: error of a strand's motion relative to that
    motion, so that small motion counts as much as large. `settling`: the same for one frame difference, so that hair comes to
    rest when it should. `parting`: error of how the strands of a lock part, relative to how far they part. `bending`: error of
    the bend from edge to edge, so that hair does not crinkle. `collision`: how far x is under the body plane nearest to x*,
    beyond MARGIN or the depth of x* itself, whichever is nearer to the body.

    Args:
        net: the network.
        batch: output of `RolloutBank.batch`.
        options: weights, and the meaning of the network's output.
    """
    strands, moments = net.strand_part(batch["strands"]), net.frame_part(batch["frames"])
    offsets = net.tail(strands[:, None], moments[:, :, None])
    offsets = offsets.unflatten(-1, (K, 3))
    moved = deform(offsets[:, :-1], batch["rest"][:, None], offsets[:, -1:], options.output)
    error = moved - batch["moved"]
    length = batch["length"][:, None, :, None]
    position = _norm(error) / length
    pairs = error.unflatten(1, (-1, 2))
    late = pairs[:, :, 1] - pairs[:, :, 0]
    velocity = _norm(late) / length
    squared = batch["length"].square()
    true = batch["moved"].unflatten(1, (-1, 2))
    true_late = (true[:, :, 1] - true[:, :, 0]).square().sum(-1).mean(-1) + CREEP**2 * squared[:, None]
    settling = (late.square().sum(-1).mean(-1) / true_late + 1e-6).sqrt()
    true_swing = _spread(batch["moved"], 1).mean((1, 3)) + STILL**2 * squared
    swing = (_spread(error, 1).mean((1, 3)) / true_swing + 1e-6).sqrt()  # smooth at zero
    true_parting = _spread(batch["moved"], 2).mean((1, 2, 3)) + TOGETHER**2 * squared.mean(1)
    parting = (_spread(error, 2).mean((1, 2, 3)) / true_parting + 1e-6).sqrt()
    edge = length / (K - 1)
    bending = _norm(torch.diff(error, n=2, dim=-2) / edge[..., None])
    normals, offset = batch["planes"][..., :3], batch["planes"][..., 3]
    target = (normals * batch["moved"]).sum(-1) - offset
    depth = torch.relu(target.clamp_max(MARGIN) - (normals * moved).sum(-1) + offset)
    return {
        "position": options.position * position.mean(),
        "velocity": options.velocity * velocity.mean(),
        "swing": options.swing * swing.mean(),
        "settling": options.settling * settling.mean(),
        "parting": options.parting * parting.mean(),
        "bending": options.bending * bending.mean(),
        "collision": options.collision * (depth / length).mean(),
    }


def _spread(vectors: Tensor, axis: int) -> Tensor:
    """Squared distance (M, moments, n, 24) of (M, moments, n, 24, 3) from its mean over an axis."""
    return (vectors - vectors.mean(axis, keepdim=True)).square().sum(-1)


def _norm(vectors: Tensor) -> Tensor:
    # Smooth at zero: a tenth of a millimetre.
    return vectors.square().sum(-1).add(1e-8).sqrt()
