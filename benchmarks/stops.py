# SPDX-License-Identifier: Apache-2.0
"""How much of generated motion shows hair that comes to rest: frames from half a second to two seconds after the head has stopped.

    python benchmarks/stops.py [--clips 400] [--seconds 3.63]

Printed for clips of which none stops midway, and for as many as trainings have (`training/data/rollouts.py`). It takes seconds.
"""

import argparse

import numpy as np
import plain_errors  # noqa: F401
from quality import CHARACTER

from neuralocks_core.animation.random_motion import random_clip
from neuralocks_core.motion import Clip
from neuralocks_core.training.data.rollouts import STOPS
from usd.shot.stage import read_rigs

STILL = 0.02
"""[m/s] The head has stopped if neither it, nor a point 0.3 m from it that turns with it, is faster."""
ARM = 0.3
AFTER = (0.5, 2.0)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=400)
    parser.add_argument("--seconds", type=float, default=3.63, help="of each; as long as a rollout if left out")
    arguments = parser.parse_args()
    character = read_rigs(CHARACTER)[0].character
    print("| stop midway | frames after a stop | clips that have some |\n| ---: | ---: | ---: |")
    for share in (0.0, STOPS):
        clips = (
            random_clip(character, np.random.default_rng(seed), arguments.seconds, stops=share)
            for seed in range(arguments.clips)
        )
        after = np.array([after_stop(clip, character.head) for clip in clips])
        print(f"| {share:.0%} | {after.mean():.1%} | {after.any(axis=1).mean():.0%} |")


def after_stop(clip: Clip, head: int) -> np.ndarray:
    """Which of a clip's steps (T - 1,) lie in AFTER, counted from when the head stopped; not those before it first moved."""
    moved, step = np.diff(clip.joints[:, head, :3], axis=0), clip.times[1] - clip.times[0]
    turned = ARM * np.linalg.norm(moved[..., :3], axis=(1, 2))
    still = np.maximum(np.linalg.norm(moved[..., 3], axis=1), turned) / step < STILL
    steps = np.arange(len(still))
    last = np.maximum.accumulate(np.where(still, -1, steps))
    since = (steps - last) * step
    return still & (last >= 0) & (since >= AFTER[0]) & (since < AFTER[1])


if __name__ == "__main__":
    main()
