# SPDX-License-Identifier: Apache-2.0
"""The paper's own training: a network that minimises the physics of random moments, without any simulation.

Three consecutive frames are predicted; the last is penalised, the two before give its inertia (paper section 3.4.5).
Every choice of the paper is there, `SelfSupervisedOptions.paper` has them together; the defaults are what keeps the
iteration stable and the hair moving. `docs/deviations.md` says why.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch

from neuralocks_core.boundary import BoundarySpec
from neuralocks_core.physics.bend_twist import Cosserat
from neuralocks_core.training.descent import Descended, Schedule, descend
from neuralocks_core.training.moment_losses import moment_losses
from neuralocks_core.training.moments import MomentPool
from neuralocks_core.training.networks import StrandNet


@dataclass(frozen=True)
class SelfSupervisedOptions:
    """How moments are learned.

    Attributes:
        minutes: wall-clock budget; `steps` wins where it is given.
        steps: number of steps, for reproducible runs.
        poses: moments in a step; the paper has one.
        strands: strands with each, in whole locks.
        pool: moments kept.
        rate: Adam's first step size, falling along a cosine.
        output: "direction" or, as in the paper, "displacement".
        motion: "linear", "encoder" or "modulated", see StrandNet.
        static: the quasi-static variant: no history, no inertia.
        undetached: weight of a second inertia term whose past is not detached. The paper's detached term alone (0)
            diverges for long, weakly damped hair; this one damps fast swings.
        warmup: share of the budget that is trained without inertia; it then rises over another tenth.
        form: how bending is measured; the paper's is `DIRECT`.
        supported: the groom carries its own weight in the bind pose, and the network's answer there is subtracted.
        random_materials: draw the four material constants for each moment; else the default ones.
        damping: damping of the default material [1/s] where materials are not random; the paper has none.
        paper_adhesion: to the nearest vertices, without rest distance.
        style: stiffness of the hair style potential by groom [1/s^2]; the last holds for all that follow.
        volume: stiffness of self-collision [m^2/s^2]; measured on a quarter of the poses, which is enough.
        seed: of weights and batches.
        device: torch device.
    """

    minutes: float = 10.0
    steps: int | None = None
    poses: int = 16
    strands: int = 16
    pool: int = 3000
    rate: float = 1e-3
    output: str = "direction"
    motion: str = "linear"
    static: bool = False
    undetached: float = 8.0
    warmup: float = 0.2
    form: Cosserat = Cosserat.EXACT
    supported: bool = True
    random_materials: bool = True
    damping: float = 10.0
    paper_adhesion: bool = False
    style: tuple[float, ...] = (0.0,)
    volume: float = 0.3
    seed: int = 0
    device: str = "cpu"

    def optimisers(self, net: torch.nn.Module) -> list[torch.optim.Optimizer]:
        """What trains `net`."""
        return [torch.optim.Adam(net.parameters(), lr=self.rate)]

    @classmethod
    def paper(cls, **changes) -> SelfSupervisedOptions:
        """The paper's choices wherever it states them, `changes` on top."""
        settings = {
            "output": "displacement",
            "undetached": 0.0,
            "warmup": 0.0,
            "form": Cosserat.DIRECT,
            "supported": False,
            "random_materials": False,
            "damping": 0.0,
            "paper_adhesion": True,
        }
        return cls(**{**settings, **changes})


def paper_boundary() -> BoundarySpec:
    """The paper's history: 30 steps of joint velocities and nothing of the head's own travel."""
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
        pool: has moments already; grows to `options.pool` meanwhile.
        inputs: what the network reads of each groom's strands, one (S, 70) a groom.
        net: normalised, on `options.device`.
        options: see there.
        optimisers: `options.optimisers(net)`, or what a checkpoint made of them.
        step, done: where an earlier run stopped.
    """
    net.train()
    rng = np.random.default_rng([options.seed, step])
    taken = 0

    def losses(done: float) -> dict[str, torch.Tensor]:
        # Moments are made one clip every few steps, so that training starts at once and is not held up long.
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
    if options.static:
        return 0.0
    return float(np.clip((done - options.warmup) / 0.1, 0.0, 1.0)) if options.warmup else 1.0
