# SPDX-License-Identifier: Apache-2.0
"""What each choice of the paper's own training is worth: one table row per variant, same scene, seed and steps.

    python benchmarks/selfsupervised.py OUT.neuralocks.training --character BODY.usd --groom GROOM.usd ... --steps 700

The folder is what `neuralocks train --keep-work` leaves behind: strand codes, and the solver's rollouts of held-out
strands and motion that all variants are measured on. No variant learns from them.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import plain_errors  # noqa: F401
import torch

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.models.network_sizes import LOCK_CODES
from neuralocks_core.physics.bend_twist import Cosserat
from neuralocks_core.strands.strand_set import StrandSet
from neuralocks_core.training.data.farm import load
from neuralocks_core.training.data.rollouts import RolloutMaker, TrainingScene
from neuralocks_core.training.gauge import measure
from neuralocks_core.training.learning.methods import MomentMethod
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.learning.regression import RolloutBank, predicted
from neuralocks_core.training.learning.selfsupervised import paper_boundary
from neuralocks_core.training.networks import StrandNet
from neuralocks_core.training.warm_start import kept_coder

OURS, PAPER = SelfSupervisedOptions(), SelfSupervisedOptions.paper()


class Choice(NamedTuple):
    """A variant: its options, its boundary history if that is not the scene's, whether the network reads the code of a strand's lock."""

    options: SelfSupervisedOptions
    spec: BoundarySpec | None = None
    locks: bool = True


ROWS: dict[str, Choice] = {
    "defaults": Choice(OURS),
    "the paper, all of it": Choice(PAPER, paper_boundary()),
    "the paper, direction output": Choice(replace(PAPER, output="direction"), paper_boundary()),
    "detached inertia only": Choice(replace(OURS, undetached=0.0)),
    "displacement output": Choice(replace(OURS, output="displacement")),
    "static": Choice(replace(OURS, static=True)),
    "no warm-up": Choice(replace(OURS, warmup=0.0)),
    "straight transport": Choice(replace(OURS, form=Cosserat.DIRECT)),
    "constant director (Quaffure)": Choice(replace(OURS, form=Cosserat.CONSTANT)),
    "no adhesion": Choice(replace(OURS, adhesion=0.0)),
    "adhesion four times as stiff": Choice(replace(OURS, adhesion=4.0)),
    "adhesion without rest distance": Choice(replace(OURS, paper_adhesion=True)),
    "style held near the body": Choice(replace(OURS, style=(2500.0,))),
    "no self-collision": Choice(replace(OURS, volume=0.0)),
    "no lock codes": Choice(OURS, locks=False),
    "no head translation": Choice(OURS, replace(BoundarySpec(), linear="none")),
}


def run(scene: TrainingScene, work: Path, rows: list[str], steps: int) -> None:
    """Train and measure each variant; prints a Markdown table as it goes, below hair carried rigidly."""
    coder = kept_coder(work)
    files = sorted((work / "held_out").glob("*.npz"))
    names = "position motion motion_static motion_ratio velocity droop penetration".split()
    print(f"{steps} steps each, seed {scene.seed}, {len(files)} held-out rollouts\n")
    print("| variant | CPU s | " + " | ".join(names) + " | parting |")
    print("| --- |" + " ---: |" * (len(names) + 2))
    for i, row in enumerate(rows):
        options, spec, locks = ROWS[row]
        options, own = replace(options, steps=steps), replace(scene, spec=spec or scene.spec)
        held_scene = replace(own, held_out=True)
        held = RolloutBank(held_scene, coder.codes_of)
        held.rollouts = [load(path) for path in files]
        if spec is not None:
            maker = RolloutMaker(held_scene)
            held.rollouts = [maker.reread(int(path.stem), r, spec) for path, r in zip(files, held.rollouts)]
        start = time.process_time()
        method = MomentMethod(own, coder.codes_of, options, None, lambda done, message: None)
        for inputs in () if locks else (*method.inputs, *held.inputs):
            inputs[:, LOCK_CODES] = 0
        torch.manual_seed(options.seed)
        net = StrandNet(own.spec.size, motion=options.motion, strand_map=options.strand_map)
        history = own.spec.slices["history"]
        net.set_normalisation(*map(torch.from_numpy, method.samples()), history, static=options.static)
        for _ in method.train(net, options.optimisers(net)):
            pass
        seconds = time.process_time() - start
        card = measure(net, held, options.output, history, options.supported).to_json()
        if i == 0:
            print(f"| hair carried rigidly | 0 | {card['rigid']:.3g} | 1 | 1 | 0 | 1 | 0 | - | 0 |")
        cells = " | ".join(f"{card[name]:.3g}" for name in names)
        print(f"| {row} | {seconds:.0f} | {cells} | {parting(net, scene.grooms, held, options):.3g} |", flush=True)


def parting(net: StrandNet, grooms: tuple[StrandSet, ...], held: RolloutBank, options: SelfSupervisedOptions) -> float:
    """How far the hairs of a lock part: rms of their displacement about the lock's mean, relative to the solver's."""
    own = true = 0.0
    for rollout in held.rollouts:
        lock = grooms[rollout.groom].lock[rollout.strands]
        target = rollout.moved.astype(np.float32) * rollout.step
        answer = predicted(net, held, rollout, options.output, options.anchored)
        for each in np.unique(lock):
            apart = [moved[rollout.first :, lock == each] for moved in (answer, target)]
            apart = [np.square(part - part.mean(axis=1, keepdims=True)).sum(dtype=float) for part in apart]
            own, true = own + apart[0], true + apart[1]
    return float(np.sqrt(own / max(true, 1e-20)))


def main() -> None:
    """Command line."""
    from usd.models.training_scene import training_scene

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", type=Path)
    parser.add_argument("--character", required=True)
    parser.add_argument("--groom", action="extend", nargs="+", required=True)
    parser.add_argument("--motion", action="extend", nargs="+", default=[])
    parser.add_argument("--steps", type=int, default=700)
    parser.add_argument("--row", action="extend", nargs="+", choices=list(ROWS), metavar="ROW", help="; ".join(ROWS))
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    scene = training_scene(arguments.character, arguments.groom, arguments.motion, seed=arguments.seed)
    run(scene, arguments.work, arguments.row or list(ROWS), arguments.steps)


if __name__ == "__main__":
    main()
