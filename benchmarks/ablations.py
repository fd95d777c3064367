# SPDX-License-Identifier: Apache-2.0
"""What each choice is worth: one table row per variant, all trained on the same rollouts with the same budget.

    python benchmarks/ablations.py OUT.neuralocks.training --character BODY.usd --groom GROOM.usd ... --minutes 3

The folder is what `neuralocks train --keep-work` leaves behind. The measures are the gauge's, on held-out strands
and motion.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import plain_errors  # noqa: F401
import torch

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.models.network_sizes import LOCK_CODES, PLAIN_STRAND, STRAND
from neuralocks_core.training.data.farm import load
from neuralocks_core.training.data.rollouts import RolloutMaker, TrainingScene
from neuralocks_core.training.gauge import measure
from neuralocks_core.training.learning.methods import samples
from neuralocks_core.training.learning.regression import RolloutBank, regress
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.networks import StrandNet
from neuralocks_core.training.warm_start import kept_coder

SPEC = BoundarySpec()
ROWS = {
    "shipped settings": {},
    "static (no history)": {"options": {"static": True}},
    "displacement output (paper)": {"options": {"output": "displacement"}},
    "no lock codes": {"locks": False},
    "no rest points (paper)": {"points": False},
    "strand part linear (paper)": {"options": {"strand_map": "linear"}},
    "strand part linear, no rest points (paper)": {"options": {"strand_map": "linear"}, "points": False},
    "frame part linear (paper)": {"options": {"motion": "linear"}},
    "frame part deeper, scales nothing": {"options": {"motion": "encoder"}},
    "AdamW for all weights": {"options": {"optimiser": "adamw", "rate": 3e-3}},
    "N = 30 single steps (paper)": {"spec": BoundarySpec(bins=(1,) * 30, taper=0.0)},
    "no taper": {"spec": replace(SPEC, taper=0.0)},
    "a taper over the last 0.3 of the history": {"spec": replace(SPEC, taper=0.3)},
    "half the history": {"spec": replace(SPEC, bins=(1,) * 12 + (2,) * 8)},
    "head's velocity instead of effective gravity": {"spec": replace(SPEC, linear="velocity")},
    "no head translation (paper)": {"spec": replace(SPEC, linear="none")},
    "no loss relative to the strand's motion": {"options": {"swing": 0.0}},
    "no loss relative to the strand's motion in a frame": {"options": {"settling": 0.0}},
    "no loss relative to how the hairs of a lock part": {"options": {"parting": 0.0}},
    "no velocity loss": {"options": {"velocity": 0.0}},
    "no collision loss": {"options": {"collision": 0.0}},
}
"""Variant -> its differences from the shipped settings."""


def run(scene: TrainingScene, work: Path, rows: list[str], budget: dict, rollouts: int) -> None:
    """Train and measure each variant; prints a Markdown table as it goes."""
    coder = kept_coder(work)
    scenes = {"rollouts": scene, "held_out": replace(scene, held_out=True)}
    files = {name: [p for p in sorted((work / name).glob("*.npz")) if p.stat().st_size][:rollouts] for name in scenes}
    print(f"{len(files['rollouts'])} rollouts, {budget} each, seed {scene.seed}\n")
    names = "position rigid motion motion_static motion_ratio velocity droop penetration".split()
    print("| variant | steps | CPU s | " + " | ".join(names) + " |")
    print("| --- |" + " ---: |" * (len(names) + 2))
    for row in rows:
        change = ROWS[row]
        options = RegressionOptions(**{**budget, **change.get("options", {})})
        spec = change.get("spec", scene.spec)
        banks = {}
        for name, which in scenes.items():
            bank = banks[name] = RolloutBank(which, coder.codes_of)
            bank.rollouts = [load(path) for path in files[name]]
            if spec != scene.spec:
                maker = RolloutMaker(which)
                bank.rollouts = [maker.reread(int(path.stem), r, spec) for path, r in zip(files[name], bank.rollouts)]
            for part, unread in (("locks", LOCK_CODES), ("points", slice(PLAIN_STRAND, STRAND))):
                if not change.get(part, True):
                    for inputs in bank.inputs:
                        inputs[:, unread] = 0
        torch.manual_seed(options.seed)
        began = time.process_time()
        net = StrandNet(spec.size, motion=options.motion, strand_map=options.strand_map)
        inputs = map(torch.from_numpy, samples(banks["rollouts"]))
        net.set_normalisation(*inputs, spec.slices["history"], static=options.static)
        *_, state = regress(banks["rollouts"], net, options, options.optimisers(net), list)
        card = measure(net, banks["held_out"], options.output, spec.slices["history"], options.anchored).to_json()
        print(
            f"| {row} | {state.step} | {time.process_time() - began:.0f} | "
            + " | ".join(f"{card[name]:.3g}" for name in names)
            + " |",
            flush=True,
        )


def main() -> None:
    """Command line."""
    from usd.models.training_scene import training_scene

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", type=Path)
    parser.add_argument("--character", required=True)
    parser.add_argument("--groom", action="extend", nargs="+", required=True)
    parser.add_argument("--motion", action="extend", nargs="+", default=[])
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--steps", type=int, help="in place of minutes; fair on a busy machine")
    parser.add_argument("--rate", type=float, default=4e-3, help="first step size; short runs want a larger one")
    parser.add_argument("--rollouts", type=int, default=10**6)
    parser.add_argument("--row", action="extend", nargs="+", choices=list(ROWS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--variations", type=int, default=0)
    arguments = parser.parse_args()
    files = arguments.character, arguments.groom, arguments.motion
    scene = training_scene(*files, seed=arguments.seed, variations=arguments.variations)
    start = time.monotonic()
    budget = {"rate": arguments.rate} | (
        {"steps": arguments.steps} if arguments.steps else {"minutes": arguments.minutes}
    )
    run(scene, arguments.work, arguments.row or list(ROWS), budget, arguments.rollouts)
    print(f"\n{(time.monotonic() - start) / 60:.0f} min in all, torch {torch.__version__}")


if __name__ == "__main__":
    main()
