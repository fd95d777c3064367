# SPDX-License-Identifier: Apache-2.0
"""How closely hair in a wind follows the solver in the same wind. No model has been trained with wind.

    python benchmarks/wind.py [--model MODEL] [--rig MODEL] [--style NAME ...] [--strands 60]

The character stands still, walks or turns its head; winds blow from one side, in gusts of half their strength, and are
named by where they blow to. Hair and clips are those of `quality.py` and `rig_quality.py`. Errors are measured after the
first second, in which the solver's hair has not yet felt earlier gusts, and averaged over styles; hair carried rigidly
has motion error and velocity error 1. It takes about two minutes of one core per style.
"""

import argparse
from dataclasses import replace

import numpy as np
import plain_errors  # noqa: F401
import quality
from rig_quality import EXAMPLE

from neuralocks_core import metrics
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.deformation.model_choice import nearest
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.motion import Clip
from neuralocks_core.reference import simulate
from neuralocks_core.rig import RigModel
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.training.rig.motion import simulate_motions
from neuralocks_core.training.rig.report import hair_points, no_turns
from neuralocks_core.wind import Wind
from usd.rig.stage import read_rigged_hair

WINDS = {
    "side, 2": (2, 0, 0),
    "back, 2": (0, 0, -2),
    "face, 2": (0, 0, 2),
    "side, 4": (4, 0, 0),
    "back, 4": (0, 0, -4),
    "face, 4": (0, 0, 4),
    "side and up, 4": (2.8, 2.8, 0),
    "side, 8": (8, 0, 0),
}
"""[m/s^2], of a character that looks along +Z."""
KINDS = ("still", "walk", "turn")
STYLES = ("long_straight", "wavy", "bob", "tight_curls")
SECONDS, FIRST = 6.0, 30
"""Length of a clip, and how many samples of it are not measured."""
HEAD = "| wind | motion | rigid position | position | motion error | rms | velocity error | motion ratio | inside % | solver |"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", help="of strands; if left out, the shipped one that suits each style")
    parser.add_argument("--rig", help="of the example's mesh hair; the shipped one if left out")
    parser.add_argument("--style", action="extend", nargs="+")
    parser.add_argument("--strands", type=int, default=60, help="of each style")
    arguments = parser.parse_args()
    quality.STRANDS = arguments.strands
    bench = quality.Bench(quality.CHARACTER, arguments.style or list(STYLES), [], None)
    models = {style: StrandModel.load(arguments.model or nearest(groom)) for style, groom in bench.styles.items()}
    strands(bench, models)
    bones(RigModel.load(arguments.rig))


def strands(bench: quality.Bench, models: dict[str, StrandModel]) -> None:
    """The table of strands."""
    print(HEAD + "\n| --- | --- |" + " ---: |" * 8)
    sessions = {style: StrandSession(models[style], groom) for style, groom in bench.styles.items()}
    for name, mean in WINDS.items():
        for kind in KINDS:
            rows = [
                _strand_row(bench, sessions[style], style, Wind(mean), clip(bench.character, kind))
                for style in sessions
            ]
            print(
                f"| {name} | {kind} | " + " | ".join(f"{value:.3g}" for value in np.mean(rows, axis=0)) + " |",
                flush=True,
            )


def _strand_row(bench: quality.Bench, session: StrandSession, style: str, wind: Wind, motion: Clip) -> list[float]:
    chosen, length = bench.chosen[style], bench.styles[style].length[bench.chosen[style]]
    times = motion.start + np.arange(round(SECONDS / quality.DT)) * quality.DT
    given, keywords = bench.setting(style, motion, times)
    rest, heads, posed = given[:3]
    truth = simulate(*given, wind=wind.at(times), **keywords).points
    motion = replace(motion, shape=np.tile(bench.shape, (len(motion.times), 1)))
    sampler = session.model.sampler(bench.character, motion)
    session.anchor(sampler.held_bind(shape=bench.shape))
    points = rest + np.stack([session.displacement(row)[chosen] for row in sampler.vectors(times, wind=wind)])
    some = slice(FIRST, None)
    answer, true = points[some], truth[some]
    error = metrics.motion_error(answer, true, length)
    inside = [quality.inside(bench, each, heads[some], posed[some], rest)[0] for each in (answer, true)]
    return [
        metrics.position_error(np.broadcast_to(rest, true.shape), true, length),
        metrics.position_error(answer, true, length),
        error["median"],
        error["rms"],
        metrics.velocity_error(answer, true, times[some]),
        metrics.motion_ratio(answer, true, times[some]),
        *inside,
    ]


def bones(model: RigModel) -> None:
    """The table of the example's mesh hair: root mean square errors of its vertices."""
    rig = read_rigged_hair(EXAMPLE / "character.usda", all_shapes=True).rig
    material = RigMaterial(**model.training["material"])
    clips = [clip(rig.character, kind) for kind in KINDS]
    rest = hair_points(rig, no_turns(rig))
    print("\n| wind | " + " | ".join(f"bones, {kind}: motion error | ratio" for kind in KINDS) + " |")
    print("| --- |" + " ---: | ---: |" * len(KINDS))
    for name, mean in WINDS.items():
        features, turns = simulate_motions(rig, material, model.spec, clips, Wind(mean))
        told = []
        for row, turn in zip(features, turns):
            true, points = (hair_points(rig, each)[FIRST:] for each in (turn, model.canonical_turns(row)))
            told.append(np.sqrt(np.square(points - true).sum() / np.square(rest - true).sum()))
            speed, own = (np.linalg.norm(np.diff(each, axis=0), axis=-1).mean() for each in (true, points))
            told.append(own / speed)
        print(f"| {name} | " + " | ".join(f"{value:.2f}" for value in told) + " |", flush=True)


def clip(character, kind: str) -> Clip:
    """A scripted clip of SECONDS; standing still is the first pose of the walk."""
    found = scripted_clip(character, "walk" if kind == "still" else kind, SECONDS)
    return replace(found, joints=np.repeat(found.joints[:1], len(found.times), axis=0)) if kind == "still" else found


if __name__ == "__main__":
    main()
