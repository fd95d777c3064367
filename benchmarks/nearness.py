# SPDX-License-Identifier: Apache-2.0
"""How far a groom may lie from what a shipped model has learned, and still be moved better by it than by the model for all hair.

    python benchmarks/nearness.py [--style STYLE ...] [--variation N ...]

Variations of the styles that no training had, each moved by the nearest specialist and by the model for all, in a turn, a jump and a bow,
beside the solver. `deformation.model_choice.NEAR` is chosen by this.
"""

from __future__ import annotations

import argparse
from functools import cache

import numpy as np
import plain_errors  # noqa: F401
import quality

from neuralocks_core import metrics
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.deformation.model_choice import distances
from neuralocks_core.hairstyles import STYLES
from neuralocks_core.models import model_file
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.reference import simulate
from neuralocks_core.strands.strand_set import strands_on

KINDS, STRANDS, SEED, SECONDS = ("turn", "jump", "bow"), 28, 7000, 4.0
BINS = (0, 20, 25, 30, 35, 100)
"""Distances [mm] between which ratios are averaged."""


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--style", nargs="+", default=list(STYLES))
    parser.add_argument("--variation", nargs="+", type=int, default=list(range(3, 9)), help="trainings had 0 to 2")
    arguments = parser.parse_args()
    print("| style | variation | nearest | mm | motion: for all | nearest | inside %: for all | nearest |")
    print("| --- | ---: | --- | ---: | ---: | ---: | ---: | ---: |")
    found = []
    for style, variation, path, far, errors in rows(arguments.style, arguments.variation):
        every, own = errors
        print(
            f"| {style} | {variation} | {path.stem} | {far:.1f} | {every[0]:.3f} | {own[0]:.3f} | {every[1]:.2f} | {own[1]:.2f} |",
            flush=True,
        )
        found.append((far, own[0] / every[0]))
    far, ratio = np.transpose(found)
    for low, high in zip(BINS[:-1], BINS[1:], strict=True):
        if (some := (far >= low) & (far < high)).any():
            print(
                f"{low} to {high} mm: {some.sum()} grooms, motion error {ratio[some].mean():.2f} times that of the model for all, at most "
                f"{ratio[some].max():.2f}"
            )


def rows(styles, variations):
    """Yield style, variation, nearest specialist, its distance [mm], and motion error and share inside [%] of the model for all and of
    the specialist.
    """
    from usd.assets.grow import Barber

    quality.STRANDS = STRANDS
    bench = quality.Bench(quality.CHARACTER, ["bob"], [], None)
    barber, load = Barber(bench.character), cache(StrandModel.load)
    for style in styles:
        for variation in variations:
            groom = strands_on(bench.character, barber.grow(style, 300, seed=SEED + variation, variation=variation))
            far = distances(groom)
            best = min(far, key=far.get)
            bench.styles = {style: groom}
            bench.chosen = {style: bench.locks(groom)}
            errors = np.mean(
                [_errors(bench, style, kind, [load(model_file.shipped()), load(best)]) for kind in KINDS], axis=0
            )
            yield style, variation, best, 1000 * far[best], errors


def _errors(bench, style: str, kind: str, models) -> list[tuple[float, float]]:
    clip = scripted_clip(bench.character, kind)
    times = np.arange(clip.start, min(clip.end, clip.start + SECONDS), quality.DT)
    given, keywords = bench.setting(style, clip, times)
    truth, (rest, heads, posed), length = simulate(*given, **keywords).points, given[:3], bench.styles[style].length
    found = []
    for each in models:
        points = rest + bench.predicted({}, style, each, clip, times)
        error = metrics.motion_error(points, truth, length[bench.chosen[style]])["median"]
        found.append((error, quality.inside(bench, points, heads, posed, rest)[0]))
    return found


if __name__ == "__main__":
    main()
