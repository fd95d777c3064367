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

import plain_errors  # noqa: F401
import torch

from neuralocks_core.boundary_spec import BoundarySpec
from neuralocks_core.physics.bend_twist import Cosserat
from neuralocks_core.training.beginning import kept_coder
from neuralocks_core.training.farm import load
from neuralocks_core.training.gauge import measure
from neuralocks_core.training.methods import MomentMethod
from neuralocks_core.training.moment_options import SelfSupervisedOptions
from neuralocks_core.training.networks import StrandNet
from neuralocks_core.training.regression import RolloutBank
from neuralocks_core.training.rollouts import RolloutMaker, TrainingScene
from neuralocks_core.training.selfsupervised import paper_boundary

OURS, PAPER = SelfSupervisedOptions(), SelfSupervisedOptions.paper()
ROWS: dict[str, tuple[SelfSupervisedOptions, BoundarySpec | None]] = {
    "defaults": (OURS, None),
    "the paper, all of it": (PAPER, paper_boundary()),
    "the paper, direction output": (replace(PAPER, output="direction"), paper_boundary()),
    "detached inertia only": (replace(OURS, undetached=0.0), None),
    "displacement output": (replace(OURS, output="displacement"), None),
    "static": (replace(OURS, static=True), None),
    "no warm-up": (replace(OURS, warmup=0.0), None),
    "straight transport": (replace(OURS, form=Cosserat.DIRECT), None),
    "constant director (Quaffure)": (replace(OURS, form=Cosserat.CONSTANT), None),
    "adhesion without rest distance": (replace(OURS, paper_adhesion=True), None),
    "style held near the body": (replace(OURS, style=(2500.0,)), None),
    "no self-collision": (replace(OURS, volume=0.0), None),
}
"""Variant -> options, and the boundary history if it is not the scene's."""


def run(scene: TrainingScene, work: Path, rows: list[str], steps: int) -> None:
    """Train and measure each variant; prints a Markdown table as it goes."""
    coder = kept_coder(work)
    files = sorted((work / "held_out").glob("*.npz"))
    names = "position static motion motion_static motion_ratio velocity droop penetration".split()
    print(f"{steps} steps each, seed {scene.seed}; rigid hair: motion and velocity 1, motion ratio and droop 0\n")
    print("| variant | s | " + " | ".join(names) + " |")
    print("| --- |" + " ---: |" * (len(names) + 1))
    for row in rows:
        options, spec = ROWS[row]
        options, own = replace(options, steps=steps), replace(scene, spec=spec or scene.spec)
        held_scene = replace(own, held_out=True)
        held = RolloutBank(held_scene, coder.codes_of)
        held.rollouts = [load(path) for path in files]
        if spec is not None:
            maker = RolloutMaker(held_scene)
            held.rollouts = [maker.reread(int(path.stem), r, spec) for path, r in zip(files, held.rollouts)]
        start = time.monotonic()
        method = MomentMethod(own, coder.codes_of, options, None, lambda done, message: None)
        torch.manual_seed(options.seed)
        net = StrandNet(own.spec.size, motion=options.motion, strand_map=options.strand_map)
        history = own.spec.slices["history"]
        net.set_normalisation(*map(torch.from_numpy, method.samples()), history, static=options.static)
        for _ in method.train(net, options.optimisers(net)):
            pass
        card = measure(net, held, options.output, history, options.supported).to_json()
        cells = " | ".join(f"{card[name]:.3g}" for name in names)
        print(f"| {row} | {time.monotonic() - start:.0f} | {cells} |", flush=True)


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
