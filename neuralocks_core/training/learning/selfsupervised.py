# SPDX-License-Identifier: Apache-2.0
"""The paper's training: a network that minimises the physics of random moments, without any simulation.

Three consecutive frames are predicted; the last one is penalised, the two before it give its inertia (paper section 3.4.5).
`SelfSupervisedOptions.paper` has the paper's choices of network, bending, adhesion and damping together; the defaults
keep the iteration stable and the hair moving. `docs/deviations.md` lists and explains the other differences.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.training.data.moments import MomentPool
from neuralocks_core.training.descent import Descended, Schedule, descend
from neuralocks_core.training.learning.moment_losses import moment_losses
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.networks import StrandNet


def paper_boundary() -> BoundarySpec:
    """The paper's history: 30 steps of joint velocities without the head's linear motion."""
    return BoundarySpec(bins=(1,) * 30, linear="none", taper=0.0)


def train_on_moments(
    pool: MomentPool,
    inputs: list[np.ndarray],
    net: StrandNet,
    options: SelfSupervisedOptions,
    optimisers: list[torch.optim.Optimizer],
    *,
    step: int = 0,
    done: float = 0.0,
) -> Iterator[Descended]:
    """Train `net` in place; the same protocol as `regression.regress`.

    Args:
        pool: already has moments; grows to `options.pool` during training.
        inputs: the network's inputs from each groom's strands, one (S, 142) per groom.
        net: normalised, on `options.device`.
        options: budget and settings.
        optimisers: `options.optimisers(net)`, or as restored from a checkpoint.
        step, done: where an earlier run stopped.
    """
    net.train()
    rng = np.random.default_rng([options.seed, step])
    taken = 0

    def losses(done: float) -> dict[str, torch.Tensor]:
        # Moments are made one clip every few steps, so that training starts at once and never waits long.
        nonlocal taken
        taken += 1
        if taken % 4 == 0 and len(pool.moments) < options.pool:
            pool.grow()
        moments, hair = pool.batch(rng, options.poses)
        return moment_losses(net, moments, hair, inputs, pool.scene.spec, options, rng, _dynamics(options, done))

    schedule = Schedule(options.minutes, options.steps, options.rate, floor=0.01, clip=5.0)
    yield from descend(optimisers, losses, schedule, step=step, done=done)
    net.eval()


def _dynamics(options: SelfSupervisedOptions, done: float) -> float:
    """Factor on inertia at a share of the budget."""
    return float(np.clip((done - options.warmup) / 0.1, 0.0, 1.0)) if options.warmup else 1.0
