# SPDX-License-Identifier: Apache-2.0
"""Quality of the shipped rig models, beside spring bones, in one run: held poses, motion, frame rates, teleports.

    python benchmarks/rig_quality.py [MODEL...] [--poses 1000] [--seed 1] [--floor] [--json]

Poses, body shapes and motion are held out: their seed is not the training's, and no training has the scripted clips. It
takes about two minutes.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import plain_errors  # noqa: F401

from neuralocks_core.animation.gestures import KINDS
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file
from neuralocks_core.motion import Clip
from neuralocks_core.rig import RigModel, rig_spec
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.training.rig.motion import RATE, motion_report, simulate_motions
from neuralocks_core.training.rig.report import hair_points, no_turns, static_report
from usd.rig.stage import read_rigged_hair

EXAMPLE = Path(__file__).resolve().parents[1] / "examples" / "mesh_hair"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    shipped = [Path(model_file.shipped("rig")), EXAMPLE / "quasi_static.neuralocks"]
    parser.add_argument("models", nargs="*", type=Path, default=shipped, help="the two shipped ones if left out")
    parser.add_argument("--character", type=Path, default=EXAMPLE / "character.usda")
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--floor", action="store_true", help="only what a network that forgets cannot do better than")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    rig = read_rigged_hair(options.character, all_shapes=True).rig
    stems = [path.stem for path in options.models]
    models = {
        stem if stems.count(stem) == 1 else str(path): RigModel.load(path) for stem, path in zip(stems, options.models)
    }
    material = RigMaterial(**next(iter(models.values())).training["material"])
    if options.floor:
        print(f"floor of forgetting: motion error {floor_of_forgetting(rig, material):.3f}")
        return
    if rig.character.body is None or not len(rig.points):
        raise NeuralocksError(f"{options.character}: no mesh of its hair can meet a body; give a character with both")
    held = {
        name: static_report(m, rig, material, options.poses, options.seed, optimised=32) for name, m in models.items()
    }
    motion = motion_report(rig, material, models)
    if options.json:
        print(json.dumps({"held": held, "motion": motion}, indent=1))
        return
    print(
        "| held poses | energy | of it collision | tips off direct, mm | inside % | deeper than 5 mm, % of poses | worst mm | "
        "joint turned most, degrees |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    first = next(iter(held))
    for name, report in held.items():
        _held_row(name, report, "network")
    _held_row("direct optimisation", held[first], "optimised")
    _held_row("carried rigidly", held[first], "rigid")
    print(
        "\n| motion | error | motion ratio | inside % | worst mm | 24 fps mm | 30 fps mm | flung by a teleport mm | for s | bytes carried on |"
    )
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    depth = motion["motion_depth"]
    own = [f"{depth['simulation']['percent']:.2f}", f"{depth['simulation']['worst_mm']:.1f}"]
    print("| simulation | 0 | 1 | " + " | ".join([*own, *"-----"]) + " |")
    for name, error in motion["motion_error"].items():
        row = [name, error, motion["motion_ratio"][name]]
        row += [f"{depth[name]['percent']:.2f}", f"{depth[name]['worst_mm']:.1f}"]
        if name in motion["rates"]:
            row += [*motion["rates"][name].values(), *motion["teleport"][name].values()]
            row += [motion["cost"][name]["bytes_carried_on"]]
        print("| " + " | ".join(map(str, row + ["-"] * (10 - len(row)))) + " |")


def floor_of_forgetting(rig, material: RigMaterial, moments: int = 8) -> float:
    """Motion error of the simulation itself, restarted at rest as long ago as the dynamic network's history reaches, at a few
    moments of each scripted clip.
    """
    steps = rig_spec(dynamic=True).steps
    clips = [scripted_clip(rig.character, kind, 4.0, RATE) for kind in KINDS]
    truth = simulate_motions(rig, material, rig_spec(), clips)[1]
    at = np.linspace(steps, truth.shape[1] - 1, moments).astype(int)
    short = [
        Clip(np.arange(steps + 1) / RATE, clip.at(clip.start + np.arange(end - steps, end + 1) / RATE))
        for clip in clips
        for end in at
    ]
    again = simulate_motions(rig, material, rig_spec(), short)[1][:, -1]
    points, true = hair_points(rig, again), hair_points(rig, truth[:, at].reshape(again.shape))
    rest = hair_points(rig, no_turns(rig))
    return float(np.sqrt(np.square(points - true).sum() / np.square(rest - true).sum()))


def _held_row(name: str, report: dict, key: str) -> None:
    depth = report[f"penetration_{key}"]
    values = [f"{report['energy'][key]:.3f}", f"{report['energy_collision'][key]:.3f}"]
    values += [f"{report['tip_error_mm'][key]:.0f}", f"{depth['percent']:.3f}"]
    values += [f"{depth['percent_of_poses_deeper_than_5_mm']:.1f}", f"{depth['worst_mm']:.1f}"]
    turned = report["most_turned"]["degrees"]
    values.append(f"{turned:.0f}" if key == "network" else "-")
    print(f"| {name} ({depth['poses']} poses) | " + " | ".join(values) + " |")


if __name__ == "__main__":
    main()
