# SPDX-License-Identifier: Apache-2.0
"""A network while it is trained: its optimisers, learning curve and checkpoint."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import asdict
from enum import Enum
from pathlib import Path

import torch

from neuralocks_core.models.shortcomings import HELD, HELD_BEGUN
from neuralocks_core.training import checkpoint
from neuralocks_core.training.data.farm import RolloutFarm
from neuralocks_core.training.data.rollouts import TrainingScene
from neuralocks_core.training.gauge import Gauge, measure
from neuralocks_core.training.learning.methods import wait
from neuralocks_core.training.learning.regression import RolloutBank
from neuralocks_core.training.networks import StrandNet
from neuralocks_core.training.option_checks import changed
from neuralocks_core.training.warm_start import Beginning

SAVE_EVERY = 45.0
"""Time between checkpoints [s]: a kill loses at most this much."""


class Run:
    """A network during training: its optimisers, learning curve and checkpoint.

    Args:
        scene: what it learns on.
        method: how it learns.
        held: held-out rollouts, on which the gauge measures, as they become available.
        saved: the checkpoint's file.
        beginning: the model whose weights replace random ones.
        resume: begin from that file.
    """

    def __init__(
        self,
        scene: TrainingScene,
        method,
        held: RolloutBank,
        saved: Path,
        beginning: Beginning | None,
        resume: bool,
    ):
        self.scene, self.method, self.held, self.saved = scene, method, held, saved
        self._options, self._history = method.options, scene.spec.slices["history"]
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self._options.seed)
            kind = {"motion": self._options.motion, "strand_map": self._options.strand_map}
            self.net = StrandNet(scene.spec.size, **kind)
        samples = map(torch.from_numpy, method.samples())
        self.net.set_normalisation(*samples, self._history, static=self._options.static)
        if beginning:
            beginning.fill(self.net)
        self.net.to(self._options.device)
        self._begun = deepcopy(self.net) if beginning else None
        self._optimisers = self._options.optimisers(self.net)
        settings = {"method": method.name, "boundary": scene.spec.to_json(), "anchored": self._options.anchored}
        settings |= {name: getattr(self._options, name, None) for name in ("output", *kind, "static", "optimiser")}
        # Tuples become lists, as in a checkpoint.
        settings, now = json.loads(json.dumps([settings, asdict(self._options, dict_factory=plain)]))
        self.meta = {"settings": settings, "options": now, "changed": [], "step": 0, "seconds": 0.0, "curve": []}
        if resume:
            kept = checkpoint.load(saved, {"net": self.net}, self._optimisers, settings, self.meta)
            since = [*map(str, kept["changed"]), *changed(kept["options"], now)]
            self.meta = {**kept, "options": now, "changed": since}

    def train(
        self, farm: RolloutFarm, held_farm: RolloutFarm, report: Callable[[float, str], None]
    ) -> dict[str, Gauge]:
        """Train until the budget is used; returns the final gauge, and that of the model that it started from.

        Raises:
            NeuralocksError: a process of the solver failed.
        """
        options, meta = self._options, self.meta
        # Relative to this run's budget: a finished run continues if it gets more time.
        spent = meta["step"] / options.steps if options.steps else meta["seconds"] / (60 * options.minutes)
        began, last = time.monotonic() - meta["seconds"], time.monotonic()
        gauge = None
        for state in self.method.train(self.net, self._optimisers, step=meta["step"], done=min(spent, 1.0)):
            for each in (farm, held_farm):
                if each.failed():
                    raise each.failure()
            now = time.monotonic()
            first = gauge is None and len(held_farm.files()) >= held_farm.count
            if now - last > SAVE_EVERY or state.done >= 1.0 or first:
                if state.done >= 1.0:  # short runs must not be judged by the few rollouts so far
                    self._wait(held_farm, report)
                last, gauge = now, self._measured(held_farm)
                self._save(state.step, now - began, gauge)
            losses = " ".join(f"{name} {value:.4f}" for name, value in state.losses.items())
            report(state.done, f"{state.step} steps, {self.method.material()}; {gauge or losses}")
        if gauge is None:
            self._wait(held_farm, report)
            gauge = self._measured(held_farm)
        return {HELD: gauge} | ({HELD_BEGUN: self._gauge(self._begun)} if self._begun else {})

    def card(self) -> dict:
        """How it was trained, for the model card."""
        other = {"resumed with other options": self.meta["changed"]} if self.meta["changed"] else {}
        return {
            "seed": self.scene.seed,
            "method": self.method.name,
            "minutes": round(self.meta["seconds"] / 60, 1),
            "steps": self.meta["step"],
            **self.method.card(),
            **other,
        }

    @staticmethod
    def _wait(held_farm: RolloutFarm, report) -> None:
        wait(held_farm, held_farm.count, lambda there, count: report(1.0, f"held-out simulations: {there} of {count}"))

    def _measured(self, held_farm: RolloutFarm) -> Gauge | None:
        """The gauge on the held-out rollouts so far, None before the first."""
        self.held.add(held_farm.files())
        return self._gauge(self.net) if self.held.rollouts else None

    def _gauge(self, net: StrandNet) -> Gauge:
        return measure(net, self.held, self._options.output, self._history, self._options.anchored)

    def _save(self, step: int, seconds: float, gauge: Gauge | None) -> None:
        curve = [*self.meta["curve"], *_told(seconds, gauge)]
        self.meta = {**self.meta, "step": step, "seconds": seconds, "curve": curve}
        checkpoint.save(self.saved, self.meta, {"net": self.net}, self._optimisers)


def plain(fields: list[tuple[str, object]]) -> dict:
    """Options as JSON values."""
    return {name: value.value if isinstance(value, Enum) else value for name, value in fields}


def _told(seconds: float, gauge) -> list[dict[str, float]]:
    """A point of the learning curve, if there is something to measure on."""
    return [] if gauge is None else [{"minutes": round(seconds / 60, 2), **gauge.to_json()}]
