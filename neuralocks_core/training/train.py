# SPDX-License-Identifier: Apache-2.0
"""Training a strand model in one command: strand codes, rollouts made alongside, the network, the model file."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import torch

from neuralocks_core import model
from neuralocks_core.boundary import BoundarySpec
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.strands import scalp_local
from neuralocks_core.training import checkpoint
from neuralocks_core.training.autoencoder import StrandAutoencoder, train_autoencoder
from neuralocks_core.training.export import strand_graphs
from neuralocks_core.training.farm import RolloutFarm
from neuralocks_core.training.gauge import measure
from neuralocks_core.training.networks import StrandNet
from neuralocks_core.training.regression import RegressionOptions, RolloutBank, regress
from neuralocks_core.training.rollouts import TrainingScene

FIRST = 24
"""Rollouts to wait for before the network starts: enough to normalise its inputs by."""
HELD_OUT = 16
"""Rollouts that the gauge measures on."""
SAVE_EVERY = 45.0
"""[s] between checkpoints: a kill loses no more than that."""


def train_strands(
    scene: TrainingScene,
    out: str | Path,
    options: RegressionOptions | None = None,
    *,
    rollouts: int = 1200,
    processes: int = 1,
    work: str | Path | None = None,
    resume: bool = False,
    keep_work: bool = False,
    credits: tuple[str, ...] = (),
    command: str = "",
    progress: Callable[[int, int, str], None] | None = None,
) -> Path:
    """Train on rollouts of the solver and write a model file.

    Args:
        scene: character, grooms, motion.
        out: the model file to write, `*.neuralocks`.
        options: budget and settings of the network's training.
        rollouts: how many to make while training goes on; about 2.4 MB of memory each.
        processes: that make rollouts; the network's training uses what is left.
        work: folder for checkpoint and rollouts; `OUT.training` beside the model where left out.
        resume: go on from the checkpoint in `work`.
        keep_work: leave `work` behind after success.
        credits: lines for the model card: whose data was used.
        command: the command line, for the model card.
        progress: called with done, total (thousandths of the budget) and a message with the gauge.

    Raises:
        NeuralocksError: nothing to train on, a checkpoint that does not fit, or a failed solver process.
    """
    options = options or RegressionOptions()
    out = Path(out)
    if out.suffix != ".neuralocks":
        raise NeuralocksError(f"{out}: a model file ends in .neuralocks; choose such a name")
    work = Path(work) if work else out.with_name(out.name + ".training")
    saved = work / "checkpoint.npz"
    if resume and not saved.exists():
        raise NeuralocksError(f"{work}: there is no checkpoint to resume; train without --resume")
    if not resume and work.exists():
        shutil.rmtree(work)
    if not any(groom.valid.any() for groom in scene.grooms):
        raise NeuralocksError("grooms: none has a strand with two distinct points; give a groom with hair")
    torch.set_num_threads(max(1, torch.get_num_threads() - processes))
    report = _Reporter(progress)
    scene_out = replace(scene, held_out=True)
    with (
        RolloutFarm(scene, work / "rollouts", rollouts, processes) as farm,
        RolloutFarm(scene_out, work / "held_out", HELD_OUT) as held_farm,
    ):
        coder = _coder(scene, work, options, report)
        codes = [coder.codes(scalp_local(groom)) for groom in scene.grooms]
        bank, held = RolloutBank(scene, codes), RolloutBank(scene_out, codes)
        _wait(farm, min(FIRST, rollouts), report)
        bank.add(farm.files())
        net = StrandNet(scene.spec.size, bank.inputs[0].shape[1], motion=options.motion)
        normalise(net, bank, scene.spec, options)
        meta = {"step": 0, "done": 0.0, "seconds": 0.0}
        modules = {"net": net}
        if resume:
            meta = checkpoint.load(saved, modules)
        began, last = time.monotonic() - meta["seconds"], time.monotonic()
        gauge = None

        def refill(optimiser):
            return checkpoint.load(saved, modules, optimiser)

        for state in regress(bank, net, options, farm.files, resume=refill if resume else None):
            if farm.failed() or held_farm.failed():
                raise NeuralocksError(
                    "training: the solver's process ended early; free some memory and go on with --resume"
                )
            now = time.monotonic()
            if (
                now - last > SAVE_EVERY
                or state["done"] >= 1.0
                or (gauge is None and len(held_farm.files()) >= HELD_OUT)
            ):
                last = now
                held.add(held_farm.files())
                if held.rollouts:
                    net.eval()
                    gauge = measure(net, held, options.output, scene.spec.slices["history"])
                    net.train()
                meta = {"step": state["step"], "done": state["done"], "seconds": now - began}
                checkpoint.save(saved, meta, modules, state["optimiser"])
            losses = " ".join(f"{name} {value:.4f}" for name, value in state["losses"].items())
            report(state["done"], f"{state['step']} steps, {len(bank.rollouts)} rollouts; {gauge or losses}")
        if gauge is None:
            _wait(held_farm, HELD_OUT, report)
            held.add(held_farm.files())
            gauge = measure(net, held, options.output, scene.spec.slices["history"])
    card = {
        "command": command,
        "seed": scene.seed,
        "method": "regression on rollouts of the reference solver",
        "minutes": round(meta["seconds"] / 60, 1),
        "steps": meta["step"],
        "rollouts": len(bank.rollouts),
        "solver residual": float(np.median([r.residual for r in bank.rollouts])),
        "strands": [int(groom.valid.sum()) for groom in scene.grooms],
        "strand code error [mm]": round(
            float(np.mean([1e3 * coder.errors(scalp_local(g)[g.valid]).mean() for g in scene.grooms])), 2
        ),
        "options": asdict(options),
    }
    description = {
        "kind": "strands",
        "boundary": scene.spec.to_json(),
        "output": options.output,
        "anchored": True,
        "static": options.static,
        "training": card,
        "report": {"held out": gauge.to_json()},
        "credits": list(credits),
    }
    path = model.write(out, description, strand_graphs(coder, net, options.output))
    if not keep_work:
        shutil.rmtree(work, ignore_errors=True)
    return path


class _Reporter:
    """Thousandths of the budget; silent where nobody listens."""

    def __init__(self, progress):
        self._progress = progress

    def __call__(self, done: float, message: str) -> None:
        if self._progress:
            self._progress(int(1000 * done), 1000, message)


def _coder(scene, work: Path, options: RegressionOptions, report) -> StrandAutoencoder:
    """The strand autoencoder: trained once, kept for a resumed run."""
    saved = work / "codes.npz"
    coder = StrandAutoencoder()
    if saved.exists():
        checkpoint.load(saved, {"coder": coder})
        return coder.eval().requires_grad_(False)
    shapes = np.concatenate([scalp_local(groom)[groom.valid] for groom in scene.grooms])
    budget = {"steps": min(1000, options.steps)} if options.steps else {"seconds": min(35.0, 6.0 * options.minutes)}
    coder = train_autoencoder(
        shapes, **budget, seed=scene.seed, progress=lambda done, total, message: report(0.0, message)
    ).cpu()
    checkpoint.save(saved, {}, {"coder": coder})
    return coder


def _wait(farm: RolloutFarm, count: int, report) -> None:
    while len(farm.files()) < count:
        if farm.failed() or not farm.alive:
            raise NeuralocksError("training: the solver's process ended early; free some memory and try again")
        report(0.0, f"first simulations: {len(farm.files())} of {count}")
        time.sleep(0.2)


def normalise(net: StrandNet, bank: RolloutBank, spec: BoundarySpec, options: RegressionOptions) -> None:
    """Set the network's input normalisation from the rollouts and strands of a bank."""
    strands = np.concatenate([bank.inputs[r.groom][r.strands] for r in bank.rollouts])
    strands = np.concatenate([strands, *(inputs[:: max(1, len(inputs) // 500)] for inputs in bank.inputs)])
    frames = np.concatenate([r.vectors for r in bank.rollouts])
    net.set_normalisation(
        torch.from_numpy(strands), torch.from_numpy(frames), spec.slices["history"], static=options.static
    )
