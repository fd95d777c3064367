# SPDX-License-Identifier: Apache-2.0
"""How well rig networks and spring bones follow a simulation of the chains: in motion, at other frame rates, after a
teleport, and at what cost.
"""

from dataclasses import asdict, astuple

import numpy as np

from neuralocks_core.animation.gestures import KINDS
from neuralocks_core.animation.random_motion import scripted_clip
from neuralocks_core.motion import Clip
from neuralocks_core.progress import Progress, silent
from neuralocks_core.reference.chain_contact import Contacts
from neuralocks_core.reference.chains import ChainSolver
from neuralocks_core.reference.spring_bones import SpringSettings, spring_bones
from neuralocks_core.rig.export_c import HISTORY_BYTES
from neuralocks_core.rig.kinematics import pose_chains, skin
from neuralocks_core.rig.network import RigModel, RigSampler, rig_spec
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial, RodTree
from neuralocks_core.rotation import from_quaternion
from neuralocks_core.training.rig.body import KEPT, BodyPatch, posed_distances, rest_distances
from neuralocks_core.training.rig.report import depths, hair_points, no_turns
from neuralocks_core.wind import Wind

RATE = 30.0
"""Samples of the simulations [Hz]."""
HISTORY, BIN = 200, 30
"""Multiply-adds of the header's history: of a push with what a read does once, and of a read for each end of a bin."""
SPRINGS, DEFAULTS = "spring bones, best of 12 settings", "spring bones, VRM's defaults"


def simulate_motions(rig: HairRig, material: RigMaterial, spec, motions, wind: Wind | None = None):
    """Features (C, T, F) and simulated turns (C, T, N, 4) of clips of equal length, sampled at RATE."""
    times = np.arange(int(round((motions[0].end - motions[0].start) * RATE)) + 1) / RATE + motions[0].start
    joints = np.stack([motion.at(times) for motion in motions])
    heads = np.stack([rig.character.canonical_to_world(poses) for poses in joints])
    features = [RigSampler(spec, rig.character, motion).features(times, wind=wind) for motion in motions]
    patch = BodyPatch.of(rig, KEPT)
    body = None if patch is None else patch.met(rig, joints)
    contacts = Contacts.of_mesh(rig.chains, rig.points, rig.weights, material.margin) if len(rig.points) else None
    solver = ChainSolver(rig.chains, RodTree(rig.chains, material), material.damping, material.weight, contacts)
    return np.stack(features), solver.simulate(heads, 1 / RATE, body, wind and wind.at(times))


def motion_report(
    rig: HairRig, material: RigMaterial, models: dict[str, RigModel], kinds=KINDS, progress: Progress | None = None
) -> dict:
    """Held-out scripted clips: models and spring bones against the simulation, and hair carried rigidly.

    Args:
        rig: the rig that the models were trained for.
        material: constants of the simulation.
        models: by their names in the report.
        kinds: kinds of clips.
        progress: called with (done, total, message).

    Returns:
        `motion_error`: rms error of `report.hair_points`, relative to hair carried rigidly (= 1). Unlike `metrics.motion_error`
        of strands, it is that of positions, not of motion about the mean: hair that hangs wrongly is wrong, too;
        `motion_error_by_kind`: the same for each kind of motion;
        `motion_ratio`: mean speed in the head's frame over the simulation's;
        `motion_depth`: hair inside the body at every eighth sample, as in `report.depths`, also for the simulation. The
        spring bones have no colliders;
        `rates`: rms difference at shared times of 24 and 30 fps from 60 fps sampling of the same motion [mm];
        `teleport`: see `_teleports`; `cost`: see `_network_cost`.
    """
    say = progress or silent
    say(0, 4, "simulating held-out motion")
    motions = [scripted_clip(rig.character, kind, 4.0, RATE) for kind in kinds]
    _, truth = simulate_motions(rig, material, rig_spec(), motions)
    true = hair_points(rig, truth)
    times = motions[0].start + np.arange(true.shape[1]) / RATE
    joints = np.stack([m.at(times) for m in motions])
    heads = np.stack([rig.character.canonical_to_world(j) for j in joints])
    say(1, 4, "moving spring bones, for comparison")
    fits = [SpringSettings(s, d, g) for s in (0.3, 1.0, 2.5) for d in (0.15, 0.4) for g in (0.0, 0.6)]
    each = SpringSettings(*np.repeat(np.transpose([astuple(fit) for fit in fits]), len(heads), axis=1))
    springs = np.split(spring_bones(rig.chains, np.tile(heads, (len(fits), 1, 1, 1)), 1 / RATE, each), len(fits))
    best = int(np.argmin([np.square(hair_points(rig, s) - true).sum(-1).mean() for s in springs]))
    candidates = {SPRINGS: springs[best], DEFAULTS: springs[fits.index(SpringSettings())]}
    for name, model in models.items():
        candidates[name] = np.stack([_model_turns(rig, model, m, times) for m in motions])
    result = _errors(rig, candidates, true, kinds) | {"motion_depth": {}}
    if rig.character.body is not None and len(rig.points):
        say(2, 4, "measuring what lies in the body in motion")
        result["motion_depth"] = _depths(rig, {"simulation": truth, **candidates}, joints)
    say(3, 4, "comparing frame rates and teleports")
    result["spring_settings"] = asdict(fits[best])
    result["rates"] = _rates(rig, models, fits[best])
    result["teleport"] = _teleports(rig, models, fits[best])
    result["cost"] = {SPRINGS: _spring_cost(rig)} | {name: _network_cost(model) for name, model in models.items()}
    return result


def _errors(rig: HairRig, candidates: dict[str, np.ndarray], true: np.ndarray, kinds) -> dict[str, dict]:
    """Errors and motion ratios of turns (C, T, N, 4) by name, one clip per kind, relative to true hair points (C, T, P, 3) [m]."""
    rest = hair_points(rig, no_turns(rig))
    carried = np.square(rest - true).sum(-1).mean(axis=(1, 2))
    speed = np.linalg.norm(np.diff(true, axis=1), axis=-1).mean()
    result = {"motion_error": {}, "motion_error_by_kind": {}, "motion_ratio": {}}
    for name, turns in candidates.items():
        points = hair_points(rig, turns)
        values = np.square(points - true).sum(-1).mean(axis=(1, 2))
        result["motion_error"][name] = round(float(np.sqrt(values.mean() / carried.mean())), 4)
        by_kind = np.sqrt(values / np.maximum(carried, 1e-12))
        result["motion_error_by_kind"][name] = {k: round(float(v), 3) for k, v in zip(kinds, by_kind)}
        ratio = np.linalg.norm(np.diff(points, axis=1), axis=-1).mean() / speed
        result["motion_ratio"][name] = round(float(ratio), 3)
    return result


def _depths(rig: HairRig, candidates: dict[str, np.ndarray], joints: np.ndarray) -> dict[str, dict]:
    """`depths` of turns (C, T, N, 4) by name at every eighth of the poses (C, T, J, 4, 4)."""
    outside = rest_distances(rig, rig.points) > 0
    few, result = joints[:, ::8].reshape(-1, *joints.shape[2:]), {}
    for name, turns in candidates.items():
        matrices = from_quaternion(turns[:, ::8].reshape(len(few), -1, 4).astype(float))
        points = skin(rig.chains, *pose_chains(rig.chains, matrices), rig.points[outside], rig.weights[outside])
        result[name] = depths(posed_distances(rig, few, points))
    return result


def _rates(rig, models, fit) -> dict:
    """One shake, sampled at 24, 30 and 60 fps."""
    fine = scripted_clip(rig.character, "shake", 4.0, 120.0)
    shared = np.arange(0, 4.0001, 0.5)
    result = {}
    for name in [SPRINGS, *models]:
        runs = {}
        for rate in (24, 30, 60):
            at = fine.start + np.arange(4 * rate + 1) / rate
            clip = Clip(at, fine.at(at))
            if name in models:
                runs[rate] = _model_points(rig, models[name], clip, fine.start + shared)
            else:
                runs[rate] = _spring_points(rig, clip, 1 / rate, fit)[(shared * rate).round().astype(int)]
        gaps = {rate: np.sqrt(np.square(runs[rate] - runs[60]).sum(-1).mean()) for rate in (24, 30)}
        result[name] = {f"{rate} fps": round(1e3 * float(gap), 2) for rate, gap in gaps.items()}
    return result


def _teleports(rig, models, fit) -> dict:
    """A character that stands still is moved 2 m aside and turned by a quarter within one frame of 1/60 s, without resetting
    its hair. How far the hair is flung from where it hung [mm], and after how many seconds it is, and stays, within 5 mm
    of it. If a network's history is reset at the cut, neither happens.
    """
    rate, before, frames = 60, 60, 240
    bind = rig.character.skeleton.bind
    jump = np.eye(4)
    jump[:3, :3], jump[:3, 3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], (2, 0, 0)
    joints = np.stack([bind] * before + [jump @ bind] * (frames - before))
    clip = Clip(np.arange(frames) / rate, joints)
    result = {}
    for name in [SPRINGS, *models]:
        if name in models:
            points = _model_points(rig, models[name], clip, clip.times)
        else:
            points = _spring_points(rig, clip, 1 / rate, fit)
        away = np.linalg.norm(points - points[before - 10], axis=-1).max(axis=-1)[before:]
        restless = np.flatnonzero(away > 5e-3)
        settled = (restless[-1] + 1) / rate if len(restless) else 0.0
        result[name] = {"flung_mm": round(1e3 * float(away.max()), 1), "seconds": round(float(settled), 2)}
    return result


def _network_cost(model: RigModel) -> dict:
    """Cost of one avatar and frame; `benchmarks/rig_speed.py` prints times. `multiply_adds` are the network's,
    `history_multiply_adds` about those of the header's push and read, without the search for the ends of bins.
    """
    work = sum(weight.size for weight, _ in model.layers) + 10 * len(model.chains)
    return {
        "multiply_adds": int(work),
        "history_multiply_adds": HISTORY + BIN * (len(model.spec.bins) + 1) if model.dynamic else 0,
        "square_roots": 2 * len(model.chains) + model.dynamic,
        "bytes_carried_on": HISTORY_BYTES if model.dynamic else 0,
    }


def _spring_cost(rig) -> dict:
    """Cost of the algorithm as specified: per joint two rotations of a vector, three normalisations and two products of
    quaternions; two tails are carried from frame to frame.
    """
    joints = len(rig.chains)
    return {
        "multiply_adds": 110 * joints,
        "history_multiply_adds": 0,
        "square_roots": 3 * joints,
        "bytes_carried_on": 24 * joints,
    }


def _spring_points(rig, clip: Clip, step: float, fit) -> np.ndarray:
    return hair_points(rig, spring_bones(rig.chains, rig.character.canonical_to_world(clip.joints)[None], step, fit))[0]


def _model_points(rig, model: RigModel, motion: Clip, times) -> np.ndarray:
    return hair_points(rig, _model_turns(rig, model, motion, times)[None])[0]


def _model_turns(rig, model: RigModel, motion: Clip, times) -> np.ndarray:
    return model.canonical_turns(RigSampler(model.spec, rig.character, motion).features(times))
