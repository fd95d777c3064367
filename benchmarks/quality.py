# SPDX-License-Identifier: Apache-2.0
"""How the network's hair compares with the solver's: per kind of motion and per hairstyle, beside the baselines.

    python benchmarks/quality.py [--model MODEL] [--static MODEL] [--floor] [--fine 8] [--motion FILE.bvh ...]
                                 [--style NAME ...] [--groom FILE ...] [--shape SEED]

Hair is grown with a seed that no model was trained on, and only the locks that training leaves out are measured; the
motion is the scripted clips, or files. Hair files instead of grown hair are placed on the head by matching two spheres:
through the roots of each folder's files, and through the scalp (`real_grooms.py` takes such files through all commands).
`--shape` gives the body a random shape. Rigid hair has motion error 1 and velocity error 1 by definition.

The scripted clips consist of the gestures that training draws at random, with sizes near the middle of the random ones: no
clip was trained on, but motion of that kind was. Everything is measured on the network's 24 vertices, before hair is kept
out of the body. `echo` is the speed of the tips half a second to two seconds after a stop, in percent of the solver's
largest after it; `echo error` is that of their difference from the solver's. `turn` is the mean angle between successive
edges: hair above the solver's is crinkled. `mirror` is how far the network's output is from its output for the same hair
and motion in a mirror, rms, in percent of the hair's displacement from rest. The floor is measured from one history's
length on, and the columns after it are the network's in the same frames. With `--fine`, the solver and the network are also
compared with the solver at so many steps per frame of 1/30 s. A case, one style in one clip, takes about six seconds of
one core, all of them a quarter of an hour.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import plain_errors  # noqa: F401
from real_grooms import on_head

from neuralocks_core import metrics
from neuralocks_core.animation.gestures import FOREIGN, KINDS, WILD
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.body.collider import Collider
from neuralocks_core.deformation.model_choice import nearest
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.materials import Material
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.reference import simulate, stateless_floor
from neuralocks_core.strands.locks import lock_mates
from neuralocks_core.strands.strand_set import strands_on
from neuralocks_core.training.data.hair_body import hair_body, posed_over_time
from neuralocks_core.training.data.mirror import POLAR, mirrored_strands, mirrored_vectors
from neuralocks_core.training.data.rollouts import RolloutMaker, held_out_split

SEED = 7001
STRANDS = 120
DT = 1 / 30
CHARACTER = Path(__file__).resolve().parents[1] / "examples/shot/body.usdc"


class Bench:
    """One character with hairstyles that no model has seen."""

    def __init__(self, character_path: str | Path, styles: list[str] | None, grooms: list[str], shape: int | None):
        from neuralocks_core.hairstyles import STYLES
        from usd.models.training_scene import training_scene

        wanted = [style for style in STYLES if not styles or style in styles]
        scene = training_scene(character_path, wanted, seed=SEED)
        self.character = scene.character
        self.styles = dict(zip(wanted, scene.grooms, strict=True))
        if grooms:
            roots = np.concatenate([g.rest[g.valid, 0] for g in scene.grooms])
            placed = on_head(grooms, scene.character, roots)
            self.styles = {path.stem: strands_on(scene.character, g) for path, g in placed.items()}
        self.body = hair_body(scene.character, reach=0.9)
        count = len(scene.character.body.shapes)
        self.shape = np.zeros(count)
        if shape is not None:
            self.shape = 0.6 * np.random.default_rng([SEED, shape]).uniform(-1, 1, count)
            maker = RolloutMaker(scene)
            self.styles = {
                n: replace(g, rest=maker.fitted(g.rest.astype(float), self.shape).astype(np.float32))
                for n, g in self.styles.items()
            }
        self.chosen = {name: self.locks(groom) for name, groom in self.styles.items()}

    def locks(self, groom) -> np.ndarray:
        """Indices of its strands that are measured."""
        usable = held_out_split(groom, True)
        order = np.random.default_rng(SEED).permutation(np.unique(groom.lock[usable]))
        rank = np.argsort(order)[np.searchsorted(np.sort(order), groom.lock[usable])]
        return np.sort(usable[np.argsort(rank, kind="stable")[:STRANDS]])

    def setting(self, style: str, clip, times):
        """What the solver needs: arguments and keywords of `simulate`."""
        groom, chosen = self.styles[style], self.chosen[style]
        rest = groom.rest[chosen].astype(float)
        joints = clip.at(times)
        posed = posed_over_time(self.body, joints @ self.character.inverse_bind, self.shape)
        bind_body = self.bind_body()
        heads = self.character.canonical_to_world(joints)
        arguments = (rest, heads, posed, self.body.triangles, Material())
        return arguments, {"dt": DT, "neighbours": lock_mates(rest, groom.lock[chosen]), "bind_body": bind_body}

    def bind_body(self) -> np.ndarray:
        """Collision vertices at rest, canonical (V, 3)."""
        return self.character.canonical(self.body.shaped(self.shape))

    def predicted(
        self, sessions: dict, style: str, model: StrandModel, clip, times, mirror=False, material=None
    ) -> np.ndarray:
        """The network's displacement (T, n, 24, 3); with `mirror`, its output for the same in a mirror, mirrored back."""
        key = (id(model), style, mirror)
        if key not in sessions:
            groom = self.styles[style]
            sessions[key] = StrandSession(model, mirrored_strands(groom) if mirror else groom)
        clip = replace(clip, shape=np.tile(self.shape, (len(clip.times), 1)))
        sampler, made_of = model.sampler(self.character, clip), (material or Material()).log_ratios()
        read = np.concatenate([sampler.held_bind(made_of, shape=self.shape)[None], sampler.vectors(times, made_of)])
        bind, *vectors = mirrored_vectors(model.spec, read) if mirror else read
        sessions[key].anchor(bind)
        moved = np.stack([sessions[key].displacement(v)[self.chosen[style]] for v in vectors])
        return moved * POLAR if mirror else moved


def inside(bench: Bench, points: np.ndarray, heads: np.ndarray, posed: np.ndarray, rest: np.ndarray) -> list[float]:
    """Shares of vertices inside the body and deeper than 3 mm [%], every 12th frame, the share in the worst of these
    frames [%] and the worst depth [mm]; without those that rest inside, and without the two clamped ones of a strand.
    """
    bind = Collider(bench.bind_body(), bench.body.triangles)
    free = bind.distance(rest[:, 2:].reshape(-1, 3), limit=0.02)[0] >= 0
    deep = []
    for frame in range(0, len(points), 12):
        world = points[frame, :, 2:].reshape(-1, 3)[free] @ heads[frame, :3, :3].T + heads[frame, :3, 3]
        distance = Collider(posed[frame], bench.body.triangles).distance(world, limit=0.02)[0]
        deepest = 1000 * max(0.0, -distance.min(initial=0.0))
        deep.append([100 * (distance < 0).mean(), 100 * (distance < -0.003).mean(), deepest])
    mean, most = np.mean(deep, axis=0), np.max(deep, axis=0)
    return [mean[0], mean[1], most[0], most[2]]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", help="if left out, the shipped one that suits each style")
    parser.add_argument("--static", help="a model trained without history, with the same budget")
    parser.add_argument("--character", default=CHARACTER, help="examples/shot/body.usdc if left out")
    parser.add_argument("--style", action="extend", nargs="+")
    parser.add_argument(
        "--kind",
        action="extend",
        nargs="+",
        choices=(*KINDS, *WILD, *FOREIGN),
        help="all but spin, tumble and bang if left out",
    )
    parser.add_argument(
        "--motion", action="extend", nargs="+", default=[], help="BVH or USD clips in place of the scripted ones"
    )
    parser.add_argument("--seconds", type=float, default=8.0, help="of each file")
    parser.add_argument("--groom", action="extend", nargs="+", default=[], help="hair files in place of grown hair")
    parser.add_argument("--shape", type=int, help="number of a random body shape")
    parser.add_argument("--floor", action="store_true", help="also what forgetting costs the solver")
    parser.add_argument(
        "--fine", type=int, default=0, help="also how far the solver's own time step is from so many in its place"
    )
    parser.add_argument(
        "--damping", type=float, default=Material().damping, help="of the network's hair in the comparison with --fine"
    )
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    bench = Bench(arguments.character, arguments.style, arguments.groom, arguments.shape)
    load = cache(StrandModel.load)
    models = {style: {"network": load(arguments.model or nearest(groom))} for style, groom in bench.styles.items()}
    for own in models.values():
        own |= {"static": load(arguments.static)} if arguments.static else {}
    if arguments.motion:
        from usd.models.clip_file import read_clip

        parts = {path.rsplit("/", 1)[-1]: read_clip(path, bench.character).parts for path in arguments.motion}
        # The solver would fly across a cut.
        clips = {name: max(own, key=lambda part: part.end - part.start) for name, own in parts.items()}
    else:
        clips = {kind: scripted_clip(bench.character, kind) for kind in arguments.kind or KINDS}
    rows = []
    sessions: dict = {}
    for kind, clip in clips.items():
        times = np.arange(clip.start, min(clip.end, clip.start + arguments.seconds), DT)
        for style in bench.styles:
            fine = arguments.fine, Material(damping=arguments.damping)
            rows.append(measured(bench, style, kind, clip, times, models[style], sessions, arguments.floor, *fine))
    if arguments.json:
        print(json.dumps(rows, indent=1, default=float))
        return
    for by in ("kind", "style"):
        table(rows, by)


def measured(
    bench: Bench, style, kind, clip, times, models, sessions, floor: bool, fine: int, beside_fine: Material
) -> dict:
    """All numbers of one style in one clip."""
    given, keywords = bench.setting(style, clip, times)
    rest, heads, posed = given[:3]
    truth = simulate(*given, **keywords).points
    length = bench.styles[style].length[bench.chosen[style]]
    row = {"kind": kind, "style": style}
    row["rigid position"] = metrics.position_error(np.broadcast_to(rest, truth.shape), truth, length)
    for name, model in models.items():
        moved = bench.predicted(sessions, style, model, clip, times)
        points = rest + moved
        error = metrics.motion_error(points, truth, length)
        row[f"{name} position"] = metrics.position_error(points, truth, length)
        row[f"{name} motion"], row[f"{name} motion rms"] = error["median"], error["rms"]
        row[f"{name} motion p95"] = error["p95"]
        row[f"{name} tips"] = metrics.position_error(points[:, :, -1:], truth[:, :, -1:], length)
        row[f"{name} velocity"] = metrics.velocity_error(points, truth, times)
        row[f"{name} ratio"] = metrics.motion_ratio(points, truth, times)
        if name == "network":
            row |= {"turn °": metrics.turning(points), "solver turn °": metrics.turning(truth)}
            row["dynamic frames"] = metrics.dynamic_frames(points, truth, times)
            stop = stops(clip, times)
            for key, of in ("settles s", points), ("solver settles s", truth):
                row[key] = metrics.settling_time(of, times, stop) if np.isfinite(stop) else float("nan")
            row["echo"], row["solver echo"] = (metrics.echo(p, truth, times, stop) for p in (points, truth))
            row["echo error"] = metrics.echo(points - truth, truth, times, stop)
            depth = inside(bench, points, heads, posed, rest)
            row |= zip(("inside", "inside 3 mm", "inside, worst frame", "inside, worst mm"), depth, strict=True)
            row["solver inside"] = inside(bench, truth, heads, posed, rest)[0]
            # Accelerations reach two steps farther than the history, and `stops` may be a step early.
            still = times >= stop + (model.spec.steps + 3) * DT
            seen = bench.predicted(sessions, style, model, clip, times, mirror=True)
            row["mirror %"] = 100 * np.sqrt(np.square(seen - moved).mean() / max(np.square(moved).mean(), 1e-12))
            row["still jitter mm"] = metrics.jitter(points[still]) if still.sum() > 1 else float("nan")
    if fine:
        finer = simulate(*given, substeps=fine, **keywords).points
        answer = rest + bench.predicted(sessions, style, models["network"], clip, times, material=beside_fine)
        for who, each in (("solver", truth), ("network", answer)):
            row[f"{who} beside fine: motion"] = metrics.motion_error(each, finer, length)["median"]
            row[f"{who} beside fine: velocity"] = metrics.velocity_error(each, finer, times)
            row[f"{who} beside fine: ratio"] = metrics.motion_ratio(each, finer, times)
    if floor and len(times) > 70:
        known = models["network"].spec.steps
        least = stateless_floor(*given, history=min(known, len(times) - 20), every=10, truth=truth, **keywords)
        row["floor motion"], row["floor motion rms"] = least.median, least.rms
        points = rest + bench.predicted(sessions, style, models["network"], clip, times)[least.frames]
        then = metrics.motion_error(points, truth[least.frames], length)
        row["network then"], row["network then rms"] = then["median"], then["rms"]
    return row


def stops(clip, times: np.ndarray) -> float:
    """When the body comes to rest [s]; NaN if the clip does not end with a second of rest."""
    joints = clip.at(times)
    moving = np.abs(np.diff(joints, axis=0)).max(axis=(1, 2, 3)) > 1e-4
    stop = times[np.flatnonzero(moving).max(initial=-1) + 1]
    return stop if times[-1] - stop > 1.0 else float("nan")


def table(rows: list[dict], by: str) -> None:
    """Means over the other column, as Markdown; motion errors of clips in which nothing moves are left out."""
    groups = defaultdict(list)
    for row in rows:
        groups[row[by]].append(row)
    names = [n for n in dict.fromkeys(n for row in rows for n in row) if n not in ("kind", "style")]
    print(f"\n| {by} | " + " | ".join(names) + " |\n| --- |" + " ---: |" * len(names))
    for key, group in [*groups.items(), ("all", rows)]:
        known = ([row[n] for row in group if not np.isnan(row.get(n, np.nan))] for n in names)
        means = [np.mean(values) if values else np.nan for values in known]
        print(f"| {key} | " + " | ".join(f"{m:.3g}" for m in means) + " |")


if __name__ == "__main__":
    main()
