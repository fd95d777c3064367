# SPDX-License-Identifier: Apache-2.0
"""How often hair jumps when it is pushed out of the body, because the network has it deep and its way out changes sides.

    python benchmarks/jumps.py [MODEL] [--style NAME ...] [--motion FILE.bvh ...] [--strands 300]

Hair is checked 48 times per second, for five seconds, in poses that breathe and in scripted clips, or in files. A strand
jumps if one of its vertices moves more than 15 mm from one check to the next, and more than three times as far as the
network moves any vertex of the strand, plus 5 mm. `jumps` counts them per strand and second; `pushed` is the share of strands
that are pushed at a time. Hair is grown with a seed that no model was trained on. It takes up to a minute of one core
per style.
"""

import argparse
from functools import cache

import numpy as np
import plain_errors  # noqa: F401
from quality import CHARACTER, Bench

from neuralocks_core.animation.puppet import FRONT, SIDE, UP, Puppet, ease, noise
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.deformation.model_choice import nearest
from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.models.runtime import StrandModel

STYLES = ("long_straight", "wavy", "fringe", "bob")
SECONDS, RATE, BREATH = 5.0, 48.0, 0.02
POSES = {
    "bowed": (1.1 * SIDE, 0.3 * SIDE, 0 * SIDE),
    "looking down": (0.2 * SIDE, 0.6 * SIDE, 0 * SIDE),
    "turned": (0.1 * UP, 1.2 * UP, 0 * SIDE),
    "tilted": (0.1 * FRONT, 0.1 * SIDE + 0.3 * UP + 0.6 * FRONT, 0 * SIDE),
    "prone": (0 * SIDE, 0 * SIDE, 1.5 * SIDE),
}
"""Rotation vectors [rad] of trunk, head and whole body for poses that are held."""
CLIPS = ("turn", "nod", "bow", "walk", "bang")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?")
    parser.add_argument("--style", action="extend", nargs="+")
    parser.add_argument(
        "--motion", action="extend", nargs="+", default=[], help="BVH or USD clips in place of poses and scripted ones"
    )
    parser.add_argument("--strands", type=int, default=300, help="of each style")
    arguments = parser.parse_args()
    load = cache(StrandModel.load)
    bench = Bench(CHARACTER, arguments.style or list(STYLES), [], None)
    if arguments.motion:
        from usd.models.clip_file import read_clip

        clips = {path.rsplit("/", 1)[-1]: read_clip(path, bench.character) for path in arguments.motion}
    else:
        clips = {name: held(bench.character, *pose) for name, pose in POSES.items()}
        clips |= {name: scripted_clip(bench.character, name, SECONDS) for name in CLIPS}
    print("| motion | style | pushed, % | strands that jump, % | jumps | farthest, mm |\n|---|---|---:|---:|---:|---:|")
    for name, clip in clips.items():
        for style, groom in bench.styles.items():
            count = min(arguments.strands, len(groom.rest))
            chosen = np.sort(np.random.default_rng(1).permutation(len(groom.rest))[:count])
            model = load(arguments.model or nearest(groom))
            print(f"| {name} | {style} | {measured(model, bench.character, groom, chosen, clip)} |", flush=True)


def held(character, trunk, head, whole):
    """A pose that is taken within a second and then held, apart from breathing."""
    times = np.arange(round(SECONDS * 30) + 1) / 30
    puppet, taken = Puppet(character, times), ease(times, 0.2, 1.0)[:, None]
    puppet.turn("root", taken * whole)
    puppet.bend_spine(taken * trunk + BREATH * noise(times, np.random.default_rng(6), 0.5))
    puppet.turn_neck(taken * head + BREATH * noise(times, np.random.default_rng(5), 0.8))
    return puppet.clip()


def measured(model: StrandModel, character, groom, chosen: np.ndarray, clip) -> str:
    """One row's numbers."""
    times = np.arange(clip.start, min(clip.end, clip.start + SECONDS), 1 / RATE)
    session, sampler = StrandSession(model, groom), model.sampler(character, clip)
    session.anchor(sampler.held_bind())
    moved = np.stack([session.displacement(vector)[chosen] for vector in sampler.vectors(times)])
    resolver, joints, pushed = Resolver(character, groom.subset(chosen), clip), clip.at(times), moved.copy()
    for displacement, now, shape in zip(pushed, joints, clip.shape_at(times), strict=True):
        resolver.apply(displacement, now, shape)
    own, steps = (1000 * np.linalg.norm(np.diff(each, axis=0), axis=3).max(axis=2) for each in (moved, pushed))
    jumps = (steps > 15) & (steps > 3 * own + 5)
    share = 100 * (pushed != moved).any(axis=(2, 3)).mean()
    rate = jumps.sum() / len(chosen) / (times[-1] - times[0])
    return f"{share:.1f} | {100 * jumps.any(axis=0).mean():.1f} | {rate:.3f} | {steps[jumps].max(initial=0):.0f}"


if __name__ == "__main__":
    main()
