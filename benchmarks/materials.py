# SPDX-License-Identifier: Apache-2.0
"""Whether the material sliders work: each constant's effect in a model beside its effect in the reference solver.

    python benchmarks/materials.py [MODEL] [--character SHOT] [--groom FILE]... [--constant NAME]...

Each constant is set to the low end, the default and the high end of its range, with the others at their defaults, in motion
that shows it. The effect is a difference of one number: `droop`, how far tips move from rest while the body bows;
`swing`, how far vertices move about their mean, and `parting`, how far the tips of neighbouring strands move apart or
together, both rms over six motions: few pairs part far, and the motion decides which, and how much damping matters. Strands
are from locks that training holds out. The last column is the model's effect divided by the solver's. It takes about a
minute per groom.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import plain_errors  # noqa: F401

from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.boundary.history import BoundarySampler
from neuralocks_core.deformation.model_choice import nearest
from neuralocks_core.deformation.strand_session import StrandSession
from neuralocks_core.materials import RANGES, Material
from neuralocks_core.models.runtime import StrandModel
from neuralocks_core.motion import Clip
from neuralocks_core.reference import simulate
from neuralocks_core.strands.locks import lock_mates
from neuralocks_core.strands.strand_set import StrandSet
from neuralocks_core.training.data.hair_body import hair_body, posed_over_time
from neuralocks_core.training.data.rollouts import RolloutMaker, TrainingScene

EVERY = ("shake", "turn", "walk", "jump", "nod", "bow")
SHOWS = {
    "bend": (("bow",), "droop"),
    "weight": (("bow",), "droop"),
    "damping": (EVERY, "swing"),
    "clumping": (EVERY, "parting"),
}
"""Constant -> the motions that show it, and the number that it changes."""
SECONDS = 3.0
SHOT = Path(__file__).parents[1] / "examples" / "shot" / "shot.usda"


def main() -> None:
    """Command line."""
    from usd.models.training_scene import training_scene

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?", default=None)
    parser.add_argument("--character", default=SHOT, help="USD stage; examples/shot/shot.usda if left out")
    parser.add_argument("--groom", action="extend", nargs="+", default=[])
    parser.add_argument("--constant", action="extend", nargs="+", choices=SHOWS, help="only these")
    parser.add_argument("--strands", type=int, default=160)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    scene = training_scene(arguments.character, arguments.groom, seed=arguments.seed)
    print("| groom | constant | shown by | low: solver | model | default | model | high | model | effect |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for number, groom in enumerate(scene.grooms):
        alone = replace(scene, grooms=(groom,), strands=arguments.strands, held_out=True, seed=number)
        drawn = RolloutMaker(alone).draw(0).strands
        strand_model = StrandModel.load(arguments.model or nearest(groom))
        measured = effects(strand_model, alone, drawn, arguments.constant or list(SHOWS))
        for name, rows in measured.items():
            cells = " | ".join(f"{true:.1f} | {ours:.1f}" for true, ours in rows)
            true, ours = rows[-1] - rows[0]
            monotone = np.all(np.diff(rows[:, 1]) * np.sign(true) > 0)
            verdict = f"{ours / true:.2f}" + ("" if monotone else ", not monotone") if abs(true) > 0.2 else "no effect"
            print(f"| {number} | {name} | {SHOWS[name][1]} [mm] | {cells} | {verdict} |", flush=True)


def effects(strand_model: StrandModel, scene: TrainingScene, drawn: np.ndarray, names) -> dict[str, np.ndarray]:
    """Constant -> (3, 2) numbers [mm] at low, default and high: the solver's and the model's."""
    groom = scene.grooms[0]
    mates = lock_mates(groom.rest[drawn], groom.lock[drawn])
    result = {}
    for name in names:
        kinds, number = SHOWS[name]
        rows = []
        for value in (RANGES[name][0], getattr(Material(), name), RANGES[name][1]):
            material, each = Material(**{name: value}), []
            for kind in kinds:
                true = solved(scene, drawn, kind, material, mates)
                ours = answered(strand_model, scene, drawn, kind, material)
                each.append([1e3 * NUMBERS[number](moved, mates) for moved in (true, ours)])
            rows.append(np.sqrt(np.square(each).mean(axis=0)))
        result[name] = np.array(rows)
    return result


def solved(scene: TrainingScene, drawn: np.ndarray, kind: str, material: Material, mates: np.ndarray) -> np.ndarray:
    """The reference's displacement (T, n, 24, 3) [m]."""
    character = scene.character
    clip = _clip(scene, kind)
    rest = scene.grooms[0].rest[drawn].astype(np.float64)
    body = hair_body(character, reach=0.2 - float(rest[..., 1].min()))
    world = None if body is None else posed_over_time(body, clip.joints @ character.inverse_bind)
    rollout = simulate(
        rest,
        character.canonical_to_world(clip.joints),
        world,
        None if body is None else body.triangles,
        material,
        dt=scene.spec.dt,
        neighbours=mates,
    )
    return rollout.points - rest


def answered(
    strand_model: StrandModel, scene: TrainingScene, drawn: np.ndarray, kind: str, material: Material
) -> np.ndarray:
    """The model's displacement (T, n, 24, 3) [m]; it sees the whole groom; otherwise locks would be cut."""
    groom: StrandSet = scene.grooms[0]
    clip = _clip(scene, kind)
    sampler = BoundarySampler(strand_model.spec, scene.character, clip)
    session, log = StrandSession(strand_model, groom), material.log_ratios()
    session.anchor(sampler.held_bind(log))
    return np.stack([session.displacement(v)[drawn] for v in sampler.vectors(clip.times, log)])


def _clip(scene: TrainingScene, kind: str) -> Clip:
    clip = scripted_clip(scene.character, kind, SECONDS, 1 / scene.spec.dt)
    body = scene.character.body
    return Clip(clip.times, clip.joints, np.zeros((len(clip.times), 0 if body is None else len(body.shapes))))


def _droop(moved: np.ndarray, mates: np.ndarray) -> float:
    return float(np.linalg.norm(moved[:, :, -1], axis=-1).max(axis=0).mean())


def _swing(moved: np.ndarray, mates: np.ndarray) -> float:
    return float(np.sqrt(np.square(moved - moved.mean(axis=0)).sum(-1).mean()))


def _parting(moved: np.ndarray, mates: np.ndarray) -> float:
    pairs = [(i, j) for i, row in enumerate(mates) for j in row if j >= 0]
    first, second = np.array(pairs).T
    gap = moved[:, first, -1] - moved[:, second, -1]
    return float(np.sqrt(np.square(gap).sum(-1).mean()))


NUMBERS = {"droop": _droop, "swing": _swing, "parting": _parting}


if __name__ == "__main__":
    main()
