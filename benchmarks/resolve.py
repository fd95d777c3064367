# SPDX-License-Identifier: Apache-2.0
"""What keeping hair out of the body costs per frame, beside what it gains.

    python benchmarks/resolve.py [MODEL] [--shot SHOT] [--every 6]

CPU time of the best of three calls, one thread, of the shot's first groom. Penetration is measured with the exact collider; a
jump is how far a vertex moves from one frame to the next relative to the head. The last line is for half frames: how far a
vertex's push, its position with this step minus that without it, moves from one to the next. It takes under a minute.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import plain_errors  # noqa: F401

MEASURED = 4
"""One strand in this many is measured."""


def main() -> None:
    """Print the table."""
    from neuralocks_core import metrics
    from neuralocks_core.deformation.resolve import Resolver
    from neuralocks_core.strands.strand_set import CLAMPED
    from usd.baking.groom_models import GroomModels
    from usd.baking.points.posing import GroomPoser
    from usd.review.demo import shipped_shot
    from usd.shot.stage import read_shot

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?")
    parser.add_argument("--shot", type=Path)
    parser.add_argument("--every", type=int, default=6)
    arguments = parser.parse_args()
    shot = read_shot(arguments.shot or shipped_shot())
    item = shot.grooms[0]
    model = GroomModels(arguments.model, threads=1).of(item)
    rig, character = item.attachment.rig, item.attachment.character
    poser = {name: GroomPoser([item], model, resolve=name == "with") for name in ("without", "with")}
    exact = Resolver(character, poser["with"].strands, rig.clip)
    began = time.process_time()
    exact.prepare()
    print(f"{shot.path.name}: {item.groom.strand_count} strands; once: {time.process_time() - began:.2f} s of CPU time")
    some = slice(None, None, MEASURED)
    rest = exact.strands.rest[some, CLAMPED:]
    rest_distance = exact.at_rest.distance(rest, limit=0.02)[0].ravel()
    distances, jumps, cost = ({name: [] for name in poser} for _ in range(3))
    codes = np.arange(shot.first, shot.last, arguments.every).tolist()
    for done, code in enumerate(codes):
        joints = rig.joints_at(code)
        collider = exact.collider(joints, rig.clip.shape_at(rig.border.seconds([code]))[0])
        for name, each in poser.items():
            now, after = each.moved(code), each.moved(code + 1)
            cost[name].append(min(_timed(each.points, code) for _ in range(3)))
            jumps[name].append(np.linalg.norm(after - now, axis=2)[:, CLAMPED:])
            where = exact.strands.rest[some, CLAMPED:] + now[some, CLAMPED:]
            distances[name].append(collider.distance(where, limit=0.02)[0].ravel())
        print(f"\r{done + 1} of {len(codes)} frames", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print(
        f"{'':>8} {'ms a frame':>10} {'most':>6} | {'inside %':>8} {'3 mm %':>7} | jump a frame: {'mean':>8} {'99.9 %':>8} mm"
    )
    for name in poser:
        depth = metrics.penetration(np.stack(distances[name]), rest_distance)
        jump, spent = 1000 * np.stack(jumps[name]), 1000 * np.array(cost[name])
        print(
            f"{name:>8} {spent.mean():10.1f} {spent.max():6.1f} | {depth['penetration_percent']:8.3f} "
            f"{depth['penetration_3mm_percent']:7.3f} | {jump.mean():23.2f} {np.quantile(jump, 0.999):8.2f}"
        )
    print("push, a half frame: " + _pushes(poser, np.arange(2 * shot.first, 2 * shot.last + 1) / 2))
    spent = {name: np.mean(values) for name, values in cost.items()}
    print(f"with / without: {spent['with'] / spent['without']:.2f}, without writing the frame")


def _pushes(poser: dict, codes: np.ndarray) -> str:
    """How far pushes move between successive samples, as text."""
    steps, before = [], None
    for code in codes.tolist():
        push = poser["with"].moved(code) - poser["without"].moved(code)
        if before is not None:
            steps.append(1000 * np.linalg.norm(push - before, axis=2).ravel())
        before = push
    # Most are zero: only the others are kept.
    count, steps = sum(map(len, steps)), np.concatenate([each[each > 0.01] for each in steps])
    far = ", ".join(f"{np.sum(steps > limit)} by more than {limit}" for limit in (5, 10, 20, 40))
    return f"of {count} steps {far}; the farthest {steps.max(initial=0):.0f} mm"


def _timed(function, *arguments) -> float:
    start = time.process_time()
    function(*arguments)
    return time.process_time() - start


if __name__ == "__main__":
    main()
