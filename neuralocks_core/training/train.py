# SPDX-License-Identifier: Apache-2.0
"""Training a strand model in one command: strand codes, training data, the network, the model file."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import asdict, replace
from enum import Enum
from pathlib import Path

import numpy as np
import torch

from neuralocks_core import model
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.progress import Progress
from neuralocks_core.shortcomings import HELD, HELD_BEGUN, KEPT
from neuralocks_core.strands.strand_set import scalp_local
from neuralocks_core.training import checkpoint
from neuralocks_core.training.autoencoder import StrandAutoencoder, train_autoencoder
from neuralocks_core.training.beginning import Beginning, kept_coder
from neuralocks_core.training.export import strand_graphs
from neuralocks_core.training.farm import RolloutFarm, check_guarded
from neuralocks_core.training.gauge import Gauge, measure
from neuralocks_core.training.methods import method_of, wait
from neuralocks_core.training.moment_options import SelfSupervisedOptions
from neuralocks_core.training.networks import StrandNet
from neuralocks_core.training.option_checks import changed, check_options
from neuralocks_core.training.regression import RolloutBank
from neuralocks_core.training.regression_options import RegressionOptions
from neuralocks_core.training.rollouts import TrainingScene, kept_from_training, learned_measures
from neuralocks_core.training.threads import threads
from neuralocks_core.training.work import (
    CODES,
    beginning_of,
    claimed,
    discard,
    keep_beginning,
    keep_inputs,
    work_folder,
)

HELD_OUT = 16
"""Rollouts that the gauge measures on."""
SAVE_EVERY = 45.0
"""Time between checkpoints [s]: a kill loses at most this much."""
THOUSANDTHS = 1000
"""Parts of the budget in which progress is reported."""


def train_strands(
    scene: TrainingScene,
    out: str | Path,
    options: RegressionOptions | SelfSupervisedOptions | None = None,
    *,
    rollouts: int = 4000,
    processes: int = 1,
    begin: str | Path | None = None,
    resume: bool = False,
    keep_work: bool = False,
    credits: tuple[str, ...] = (),
    command: str = "",
    tell: Callable[[list[str]], None] | None = None,
    progress: Progress | None = None,
) -> Path:
    """Train on rollouts of the solver, or on the physics of random moments, and write a model file.

    The solver works in spawned processes, which import the calling script again: a script must call this under
    `if __name__ == "__main__":`.

    Args:
        scene: character, grooms, motion.
        out: the model file to write, `*.neuralocks`.
        options: budget and settings of the network's training; their type chooses the method: RegressionOptions
            for rollouts, SelfSupervisedOptions for the paper's.
        rollouts: how many to make while training goes on; the latest `regression.MOST` are kept, 2.4 MB of memory and disk each.
        processes: processes that make rollouts; the network's training uses the remaining cores.
        begin: a model whose network and strand codes training starts from, instead of random weights and new codes.
        resume: continue from the folder `OUT.training` beside the model: simulations, strand codes, and the checkpoint if there
            is one; with a larger budget than before, a finished run trains longer.
        keep_work: keep `OUT.training` after success.
        credits: lines for the model card: whose data was used.
        command: the command line, for the model card.
        tell: called with notes for the user about a resumed training.
        progress: called with done, total and a message: first for simulations, then in thousandths of the budget with the
            gauge.

    Raises:
        NeuralocksError: an option out of bounds, nothing to train on, a model or checkpoint that does not fit, or a
            failed solver process.
    """
    check_guarded()
    options = options or RegressionOptions()
    check_options(options, rollouts, processes)
    out, work = Path(out), work_folder(out, resume)
    start = beginning_of(work, begin, resume)
    beginning = Beginning(start) if start else None
    if beginning:
        beginning.check(scene.spec, options, resume)
    if not any(groom.valid.any() for groom in scene.grooms):
        raise NeuralocksError("grooms: none has a strand with two distinct points; give a groom with hair")
    report = _Reporter(progress)
    with claimed(work):
        if not resume:
            discard(work)
            if start:
                keep_beginning(start, work)
        keep_inputs(scene, work, resume)
        description, graphs = _trained(scene, work, options, rollouts, processes, beginning, resume, tell, report)
        description["training"] = {"command": command, **description["training"]}
        description["credits"] = list(dict.fromkeys([*description["credits"], *credits]))
        path = model.write(out, description, graphs)
        if not keep_work:
            discard(work)
    return path


def _trained(
    scene, work: Path, options, rollouts: int, processes: int, beginning: Beginning | None, resume: bool, tell, report
) -> tuple[dict, dict]:
    """The trained model's description and graphs; see `train_strands`."""
    saved = work / "checkpoint.npz"
    scene_out = replace(scene, held_out=True)
    count = 0 if isinstance(options, SelfSupervisedOptions) else rollouts
    processes = processes if count else 0
    with (
        threads(max(1, torch.get_num_threads() - processes)),  # one core is left for each process that makes rollouts
        RolloutFarm(scene, work / "rollouts", count, processes) as farm,
        RolloutFarm(scene_out, work / "held_out", HELD_OUT) as held_farm,
    ):
        coder = beginning.coder() if beginning else _coder(scene, work, options, report)
        method = method_of(scene, coder.codes_of, options, farm, report)
        run = _Run(scene, method, RolloutBank(scene_out, coder.codes_of), saved, beginning, resume and saved.exists())
        if tell and run.meta["changed"]:
            tell([f"{work}: continues with other options than it began with: {', '.join(run.meta['changed'])}"])
        told = run.train(farm, held_farm, report)
    card = {**run.card(), **_inputs_of(scene, coder, beginning), "options": asdict(options, dict_factory=_plain)}
    description = {
        "kind": "strands",
        "boundary": scene.spec.to_json(),
        "output": options.output,
        "anchored": options.anchored,
        "static": options.static,
        "training": {**card, "curve": run.meta["curve"]},
        "report": {name: gauge.to_json() for name, gauge in told.items()},
        "credits": list(beginning.credits) if beginning else [],
    }
    return description, strand_graphs(coder, run.net, options.output)


class _Run:
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
        settings, now = json.loads(json.dumps([settings, asdict(self._options, dict_factory=_plain)]))
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
            first = gauge is None and len(held_farm.files()) >= HELD_OUT
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
        wait(held_farm, HELD_OUT, lambda there, count: report(1.0, f"held-out simulations: {there} of {count}"))

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


class _Reporter:
    """Reports progress in thousandths of the budget, or in `parts` of an earlier step; silent if nobody listens."""

    def __init__(self, progress):
        self._progress = progress

    def __call__(self, done: float, message: str, parts: int = THOUSANDTHS) -> None:
        if self._progress:
            self._progress(int(parts * done + 1e-6), parts, message)


def _inputs_of(scene: TrainingScene, coder: StrandAutoencoder, beginning: Beginning | None) -> dict:
    """For the card: measures of the body, strands of each groom, how many of them are held out, and the source of their codes, or
    the codes' error.
    """
    lowest, highest = learned_measures(scene.character).round(4).tolist()
    strands = {"measures": {"lowest": lowest, "highest": highest}}
    strands["strands"] = [int(groom.valid.sum()) for groom in scene.grooms]
    strands[KEPT] = [kept_from_training(groom) for groom in scene.grooms]
    if beginning:
        return strands | {"began with": beginning.card()}
    errors = [1e3 * coder.errors(scalp_local(groom)[groom.valid]).mean() for groom in scene.grooms if groom.valid.any()]
    return strands | {"strand code error [mm]": round(float(np.mean(errors)), 2)}


def _coder(scene, work: Path, options, report) -> StrandAutoencoder:
    """The strand autoencoder: trained once, and kept for a resumed run."""
    saved = work / CODES
    if saved.exists():
        return kept_coder(work)
    shapes = np.concatenate([scalp_local(groom)[groom.valid] for groom in scene.grooms])
    budget = {"steps": min(1000, options.steps)} if options.steps else {"seconds": min(35.0, 4.0 * options.minutes)}
    coder = train_autoencoder(
        shapes, **budget, seed=scene.seed, progress=lambda done, total, message: report(0.0, message)
    )
    checkpoint.save(saved, {}, {"coder": coder})
    return coder


def _told(seconds: float, gauge) -> list[dict[str, float]]:
    """A point of the learning curve, if there is something to measure on."""
    return [] if gauge is None else [{"minutes": round(seconds / 60, 2), **gauge.to_json()}]


def _plain(fields: list[tuple[str, object]]) -> dict:
    """Options as JSON values."""
    return {name: value.value if isinstance(value, Enum) else value for name, value in fields}
