# SPDX-License-Identifier: Apache-2.0
"""The loop under every training here: a budget of time or steps, warm-up, cosine, clipped gradients."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.model_file import REMEDIES

Losses = Callable[[float], dict[str, torch.Tensor]]
"""Used share of the budget (0..1) -> named, weighted losses of one batch; their sum is minimised."""


@dataclass(frozen=True)
class Schedule:
    """Budget and step sizes.

    Attributes:
        minutes: wall-clock budget; `steps` takes precedence.
        steps: number of steps, which makes a run repeatable.
        rate: largest step size.
        floor: share of it at the end of the cosine.
        warm_up: steps in which the step size grows to `rate`.
        clip: largest norm of a step's gradient.
        smoothing: steps over which displayed losses are averaged.
    """

    minutes: float = 10.0
    steps: int | None = None
    rate: float = 1e-3
    floor: float = 0.005
    warm_up: int = 200
    clip: float = 1.0
    smoothing: float = 100.0

    def rate_at(self, step: int, done: float) -> float:
        """Step size of a step (from 0) when a share `done` of the budget is used."""
        cosine = 0.5 * (1 + np.cos(np.pi * min(max(done, 0.0), 1.0)))
        return self.rate * min(1.0, (step + 1) / max(self.warm_up, 1)) * (self.floor + (1 - self.floor) * cosine)


@dataclass(frozen=True)
class Descended:
    """Where a descent stands: steps taken, share of the budget used (0..1), running means of the losses."""

    step: int
    done: float
    losses: dict[str, float]


def descend(
    optimisers: Sequence[torch.optim.Optimizer],
    losses: Losses,
    schedule: Schedule,
    *,
    step: int = 0,
    done: float = 0.0,
    remedy: str = "",
) -> Iterator[Descended]:
    """Minimise the sum of `losses` over the parameters of the optimisers; leave the loop to stop.

    Args:
        optimisers: each with parameters of its own; their step sizes are set before each step.
        losses: called once per step; it may also do other periodic work.
        schedule: budget and step sizes.
        step, done: where an earlier run with the same budget stopped.
        remedy: what a user can do if losses diverge; a smaller `--set rate` if left out.

    Yields:
        about once a second, and after the last step.

    Raises:
        NeuralocksError: a loss or a weight is not finite when the next state is due.
    """
    groups = [group for optimiser in optimisers for group in optimiser.param_groups]
    parameters = [p for group in groups for p in group["params"]]
    before, start = done, time.monotonic()
    shown, running = start, {}
    while done < 1.0:
        for group in groups:
            group["lr"] = schedule.rate_at(step, done)
        values = losses(done)
        for parameter in parameters:
            parameter.grad = None
        sum(values.values()).backward()
        torch.nn.utils.clip_grad_norm_(parameters, schedule.clip)
        for optimiser in optimisers:
            optimiser.step()
        step += 1
        now = time.monotonic()
        done = step / schedule.steps if schedule.steps else before + (now - start) / (60 * schedule.minutes)
        for name, value in values.items():
            value = float(value.detach())
            running[name] = running.get(name, value) + (value - running.get(name, value)) / schedule.smoothing
        if now - shown > 1.0 or done >= 1.0:
            shown = now
            if not (np.isfinite(list(running.values())).all() and all(bool(p.isfinite().all()) for p in parameters)):
                remedy = remedy or f"{REMEDIES['strands']} than {schedule.rate:g}"
                raise NeuralocksError(f"training: it diverged, its loss is not finite after {step} steps; {remedy}")
            yield Descended(step, min(done, 1.0), dict(running))
