# SPDX-License-Identifier: Apache-2.0
"""How good a rig network is in held poses: energy relative to direct optimisation, and how much hair is inside the body."""

import numpy as np
import torch

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.metrics import DEEP, ROUNDING
from neuralocks_core.progress import Progress, silent, within
from neuralocks_core.rig.kinematics import bone_ends, pose_chains, skin
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.rotation import from_quaternion
from neuralocks_core.training.rig.body import rest_distances
from neuralocks_core.training.rig.energy import RigEnergy, bounded_turns
from neuralocks_core.training.rig.poses import PosePool

POINTS = 400
"""Points of a hair mesh by which its motion is measured."""
OPTIMISED = 250
"""Steps of the direct optimisation from each of its starts."""
TOGETHER = 64
"""Poses whose hair is skinned at once: of 1,000, a mesh of 20,000 vertices takes gigabytes."""


def static_report(
    model, rig, material: RigMaterial, count: int, seed: int, progress: Progress | None = None, optimised: int = 16
) -> dict:
    """The report of a model over held-out poses and body shapes.

    Args:
        model: the trained RigModel.
        rig: the rig that it was trained for.
        material: constants of the energy.
        count: held-out poses and body shapes for the penetration.
        seed: decides them; use another seed than training.
        progress: called with (done, total, message).
        optimised: number of them that are also optimised directly.

    Returns:
        plain numbers; energies in m^2/s^2 per unit of mass, zero in the bind pose, shares in percent, depths and
        distances in millimetres. `energy`: means over the optimised poses; `excess_percent` is the network's excess
        over direct optimisation, which is not fully converged, in percent of the latter's magnitude. `tip_error_mm`: mean
        distance of the chains' ends from those of direct optimisation. `most_turned`: the joint that is turned most on
        average over all poses, and by how much [degrees]; it reveals a lock that stands out from the head.
        `penetration_*`: for the vertices that are outside at rest, exact distances.
    """
    say = progress or silent
    pool = PosePool(rig, count, np.random.default_rng(seed))
    poses = np.arange(count)
    gravity = pool.gravity(poses)
    turns = model.canonical_turns(pool.features(model.spec, poses, gravity))
    rigid = np.broadcast_to(no_turns(rig), turns.shape)
    few = poses[: min(optimised, count)]
    energy = RigEnergy(rig, material)
    directly = _optimise(energy, pool, few, gravity[few], model.max_angle, turns[few], within(say, 0, 300))
    states = {"network": turns, "optimised": directly}
    states["rigid"] = rigid[: max(len(few), count // 20)]
    report = {"poses": count, "energy": {}, "energy_collision": {}}
    for name, state in states.items():
        with torch.no_grad():
            q = torch.as_tensor(state[few], dtype=torch.float32)
            elastic, collision = energy.parts(pool, few, q, gravity[few])
        report["energy"][name] = float((elastic + collision).mean())
        report["energy_collision"][name] = float(collision.mean())
    best = report["energy"]["optimised"]
    report["energy"]["excess_percent"] = 100 * (report["energy"]["network"] - best) / max(abs(best), 1e-9)
    tips = {name: _ends(rig, state[few])[:, rig.chains.bone_end < 0] for name, state in states.items()}
    off = {name: np.linalg.norm(points - tips["optimised"], axis=-1) for name, points in tips.items()}
    report["tip_error_mm"] = {name: 1e3 * float(distance.mean()) for name, distance in off.items()}
    angle = np.degrees(2 * np.arccos(np.clip(np.abs(turns[..., 0]), 0, 1)).mean(axis=0))
    report["most_turned"] = {"joint": leaf(rig.chains.names[angle.argmax()]), "degrees": float(angle.max())}
    if pool.collides:
        rest = rest_distances(rig, rig.points)
        outside, done, whole = rest > 0, 0, sum(map(len, states.values()))
        for name, state in states.items():
            distance = []
            for first in range(0, len(state), TOGETHER):
                some = state[first : first + TOGETHER]
                begin, done = done, done + len(some)
                tell = within(say, 300 + 700 * begin // whole, 300 + 700 * done // whole)
                points = skin(rig.chains, *pose_chains(rig.chains, from_quaternion(some)), rig.points, rig.weights)
                distance.append(pool.distances(poses[first : first + TOGETHER], points, tell)[:, outside])
            report[f"penetration_{name}"] = depths(np.concatenate(distance))
        report["hair_vertices"] = int(outside.sum())
        report["hair_vertices_inside_at_rest"] = int((~outside).sum())
        report["depth_at_rest_mm"] = 1e3 * float(max(0.0, -rest.min()))
    say(1000, 1000, "report done")
    return report


def hair_points(rig, turns: np.ndarray) -> np.ndarray:
    """Positions of the hair, canonical (..., P, 3) [m], for turns (..., N, 4): at most POINTS evenly chosen vertices of its
    mesh, or the bones' ends if it has none. Vertices show locks that twist about themselves, ends do not.
    """
    posed = pose_chains(rig.chains, from_quaternion(turns.reshape(-1, *turns.shape[-2:]).astype(float)))
    few = np.linspace(0, len(rig.points) - 1, min(POINTS, len(rig.points))).astype(int)
    if len(few):
        points = skin(rig.chains, *posed, rig.points[few], rig.weights[few])
    else:
        points = bone_ends(rig.chains, *posed)
    return points.reshape(*turns.shape[:-2], -1, 3)


def no_turns(rig) -> np.ndarray:
    """The turns (N, 4) wxyz of hair that is carried rigidly."""
    return np.tile([1.0, 0.0, 0.0, 0.0], (len(rig.chains), 1))


def depths(distance: np.ndarray) -> dict:
    """Shares and depths in the body of signed distances (B, V) [m]."""
    share = 100 / max(distance.size, 1)
    deepest = np.abs(distance.min(axis=1, initial=0.0))
    return {
        "poses": len(distance),
        "percent": share * float((distance < -ROUNDING).sum()),
        "percent_deeper_than_3_mm": share * float((distance < -DEEP).sum()),
        "percent_of_poses_deeper_than_5_mm": 100 * float((deepest > 5e-3).mean()),
        "worst_mm": 1e3 * float(deepest.max()),
    }


def _ends(rig, turns: np.ndarray) -> np.ndarray:
    return bone_ends(rig.chains, *pose_chains(rig.chains, from_quaternion(turns)))


def _optimise(energy, pool, poses, gravity, max_angle, start, say) -> np.ndarray:
    """Turns (B, N, 4) of the lowest energy that Adam meets on its way from the network's own output and from rest; its steps may
    push hair through the body, from where it does not come back.
    """
    vector = start[..., 1:] / np.sin(max_angle / 2)
    near = vector / np.sqrt(np.maximum(1 - np.sum(vector**2, axis=-1, keepdims=True), 1e-3))
    lowest, state = np.full(len(poses), np.inf), start
    for turn, first in enumerate((near, np.zeros_like(near))):
        raw = torch.tensor(first, dtype=torch.float32, requires_grad=True)
        optimiser = torch.optim.Adam([raw], lr=0.03, betas=(0.8, 0.98))
        for step in range(OPTIMISED + 1):
            turns = bounded_turns(raw, max_angle)
            values = sum(energy.parts(pool, poses, turns, gravity))
            met = values.detach().numpy()
            better = met < lowest
            lowest = np.where(better, met, lowest)
            state = np.where(better[:, None, None], turns.detach().numpy(), state)
            if step == OPTIMISED:
                break
            say(turn * OPTIMISED + step, 2 * OPTIMISED, "optimising directly, for comparison")
            optimiser.param_groups[0]["lr"] = 0.03 * (1 - step / OPTIMISED) ** 1.5 + 1e-4
            optimiser.zero_grad()
            values.sum().backward()
            optimiser.step()
    return state.astype(float)
