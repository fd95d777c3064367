# SPDX-License-Identifier: Apache-2.0
"""How good a quasi-static rig network is: energy against direct optimisation, and how much hair lies in the body."""

import numpy as np
import torch

from neuralocks_core.collider import Collider
from neuralocks_core.rig.kinematics import pose_chains, quaternion_matrices, skin
from neuralocks_core.training.rig_energy import RigEnergy, RigMaterial, bounded_turns
from neuralocks_core.training.rig_poses import PosePool


def static_report(model, rig, material: RigMaterial, count: int, seed: int, progress=None, optimised: int = 64) -> dict:
    """The report of a quasi-static model over held-out poses.

    Args:
        model: the trained RigModel.
        rig: what it was trained for.
        material: constants of the energy.
        count: held-out poses and body shapes for the penetration.
        seed: decides them; not the seed of training.
        progress: called with (done, total, message).
        optimised: how many of them are also optimised directly.

    Returns:
        plain numbers; energies in m^2/s^2 per unit of mass, shares in percent, depths and distances in millimetres.
    """
    from neuralocks_core.training.rig import prepare_rest, total_energy

    say = progress or (lambda done, total, message: None)
    rng = np.random.default_rng(seed)
    pool = PosePool(rig, count, rng)
    poses = np.arange(count)
    gravity = pool.gravity(poses)
    turns = model.canonical_turns(pool.features(model.spec, poses, gravity))
    rigid = np.zeros_like(turns)
    rigid[..., 0] = 1
    report = {"poses": count}
    few = poses[: min(optimised, count)]
    energy = RigEnergy(rig, material)
    prepare_rest(energy, rig)
    say(0, 3, "optimising directly, for comparison")
    best, state = _optimise(energy, pool, few, gravity[few], model.max_angle, turns[few])
    with torch.no_grad():
        values = {
            name: float(total_energy(energy, pool, few, torch.as_tensor(q, dtype=torch.float32), gravity[few]).mean())
            for name, q in (("network", turns[few]), ("rigid", rigid[few]))
        }
    report["energy"] = {"network": values["network"], "optimised": best, "rigid": values["rigid"]}
    report["energy"]["excess_percent"] = 100 * (values["network"] - best) / max(abs(best), values["rigid"] - best, 1e-9)
    chains = rig.chains
    tips = {}
    for name, q in (("network", turns[few]), ("optimised", state), ("rigid", rigid[few])):
        rotation, position = pose_chains(chains, quaternion_matrices(q))
        joint = chains.bone_joint
        ends = position[:, joint] + np.einsum("bmij,mj->bmi", rotation[:, joint], chains.bones)
        tips[name] = ends[:, chains.bone_end < 0]
    for name in ("network", "rigid"):
        report[f"tip_error_mm_{name}"] = 1e3 * float(np.linalg.norm(tips[name] - tips["optimised"], axis=-1).mean())
    if pool.points is not None:
        say(1, 3, "measuring what lies in the body")
        rest = PosePool(rig, 1, np.random.default_rng(0), most_points=100_000)
        outside = _distances(rest, [0], rig.points[None])[0] > 0
        for name, q in (("network", turns), ("rigid", rigid)):
            points = skin(chains, *pose_chains(chains, quaternion_matrices(q)), rig.points, rig.weights)
            distance = np.where(outside, _distances(pool, poses, points, exact=name == "network"), 1.0)
            report[f"penetration_{name}"] = {
                "percent": 100 * float((distance < 0).sum() / (count * max(outside.sum(), 1))),
                "percent_deeper_than_3_mm": 100 * float((distance < -3e-3).sum() / (count * max(outside.sum(), 1))),
                "worst_mm": float(1e3 * max(0.0, -distance.min())),
            }
        report["hair_vertices"] = int(outside.sum())
        report["hair_vertices_inside_at_rest"] = int((~outside).sum())
    say(3, 3, "report done")
    return report


def _optimise(energy, pool, poses, gravity, max_angle, start, steps: int = 250):
    """Lowest mean energy found by Adam from the network's own answer and from rest, and its turns (B, N, 4)."""
    from neuralocks_core.training.rig import total_energy

    size = np.sin(max_angle / 2)
    vector = start[..., 1:] / size
    near = vector / np.sqrt(np.maximum(1 - np.sum(vector**2, axis=-1, keepdims=True), 1e-3))
    lowest, state = None, None
    for first in (near, np.zeros_like(near)):
        raw = torch.tensor(first, dtype=torch.float32, requires_grad=True)
        optimiser = torch.optim.Adam([raw], lr=0.03, betas=(0.8, 0.98))
        for step in range(steps):
            optimiser.param_groups[0]["lr"] = 0.03 * (1 - step / steps) ** 1.5 + 1e-4
            values = total_energy(energy, pool, poses, bounded_turns(raw, max_angle), gravity)
            optimiser.zero_grad()
            values.sum().backward()
            optimiser.step()
        with torch.no_grad():
            turns = bounded_turns(raw, max_angle)
            values = total_energy(energy, pool, poses, turns, gravity).numpy()
        turns = turns.numpy().astype(float)
        if lowest is None:
            lowest, state = values, turns
        else:
            better = values < lowest
            lowest, state = np.where(better, values, lowest), np.where(better[:, None, None], turns, state)
    return float(lowest.mean()), state


def _distances(pool: PosePool, poses, points: np.ndarray, exact: bool = True) -> np.ndarray:
    """Signed distances (B, V) [m] to the body where a vertex may be in it, 1 elsewhere; to planes of vertices if
    not `exact`.
    """
    normals, offsets = pool.planes(poses, points)
    plane = np.einsum("bvi,bvi->bv", normals, points) - offsets
    result = np.where(plane < 2e-3, plane, 1.0)
    for row, pose in enumerate(poses if exact else ()):
        near = np.flatnonzero(plane[row] < 2e-3)
        if not len(near):
            continue
        body, at = pool.points[pose], points[row][near]
        hits = pool.around(pose, at, 0.045)
        reach = np.zeros(len(body), bool)
        reach[np.unique(np.concatenate([np.asarray(h, int) for h in hits]))] = True
        # Around vertices at the surface a patch of it is enough; one that is far from it needs the whole to tell
        # its side.
        whole = any(len(h) == 0 for h in hits)
        faces = pool.triangles if whole else pool.triangles[reach[pool.triangles].any(axis=1)]
        result[row, near] = Collider(body, faces).distance(at)[0]
    return result
