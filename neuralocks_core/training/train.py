# SPDX-License-Identifier: Apache-2.0
"""Training a strand model in one command: strand codes, training data, the network, the model file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import torch

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from neuralocks_core.models.shortcomings import KEPT
from neuralocks_core.progress import Progress
from neuralocks_core.strands.resemblance import learned_hair
from neuralocks_core.strands.strand_set import scalp_local
from neuralocks_core.training import checkpoint
from neuralocks_core.training.autoencoder import StrandAutoencoder, train_autoencoder
from neuralocks_core.training.data.farm import RolloutFarm, check_guarded
from neuralocks_core.training.data.rollouts import TrainingScene, kept_from_training, learned_measures
from neuralocks_core.training.export import strand_graphs
from neuralocks_core.training.learning.methods import method_of
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.learning.regression import RolloutBank
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.option_checks import check_options
from neuralocks_core.training.run import Run, plain
from neuralocks_core.training.threads import threads
from neuralocks_core.training.warm_start import Beginning, kept_coder
from neuralocks_core.training.work_folder import (
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
    for number, groom in enumerate(scene.grooms):
        if not groom.valid.any():
            raise NeuralocksError(f"grooms: number {number} has no strand with two distinct points; leave it out")
    if not scene.grooms:
        raise NeuralocksError("grooms: there is none; give a groom with hair")
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
        path = model_file.write(out, description, graphs)
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
        run = Run(scene, method, RolloutBank(scene_out, coder.codes_of), saved, beginning, resume and saved.exists())
        if tell and run.meta["changed"]:
            tell([f"{work}: continues with other options than it began with: {', '.join(run.meta['changed'])}"])
        told = run.train(farm, held_farm, report)
    card = {**run.card(), **_inputs_of(scene, coder, beginning), "options": asdict(options, dict_factory=plain)}
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


class _Reporter:
    """Reports progress in thousandths of the budget, or in `parts` of an earlier step; silent if nobody listens."""

    def __init__(self, progress):
        self._progress = progress

    def __call__(self, done: float, message: str, parts: int = THOUSANDTHS) -> None:
        if self._progress:
            self._progress(int(parts * done + 1e-6), parts, message)


def _inputs_of(scene: TrainingScene, coder: StrandAutoencoder, beginning: Beginning | None) -> dict:
    """For the card: measures of the body, strands of each groom, how many of them are held out, some of them, and the source of
    their codes, or the codes' error.
    """
    lowest, highest = learned_measures(scene.character).round(4).tolist()
    strands = {"measures": {"lowest": lowest, "highest": highest}}
    strands["strands"] = [int(groom.valid.sum()) for groom in scene.grooms]
    strands[KEPT] = [kept_from_training(groom) for groom in scene.grooms]
    strands["hair"] = learned_hair(scene.grooms)
    if beginning:
        return strands | {"began with": beginning.card()}
    errors = [1e3 * coder.errors(scalp_local(groom)[groom.valid]).mean() for groom in scene.grooms]
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
