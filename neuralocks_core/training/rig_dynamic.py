# SPDX-License-Identifier: Apache-2.0
"""Training the dynamic variant of a rig's network: regression on simulations of its chains under random motion.

The network stays a pure function of the boundary history; what it learns to answer is what the simulation did
after the same history.
"""

import time
from dataclasses import asdict

import numpy as np
import torch

from neuralocks_core.random_motion import KINDS, random_clip, scripted_clip
from neuralocks_core.reference.chains import BodyPoints, ChainSolver
from neuralocks_core.reference.spring_bones import SpringSettings, spring_bones
from neuralocks_core.rig.kinematics import bone_ends, pose_chains, quaternion_matrices
from neuralocks_core.rig.network import RigModel, RigSampler, input_limits, rig_spec
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.training.rig import TinyNet, prepare_rest
from neuralocks_core.training.rig_energy import RigEnergy, RigMaterial, RodTree
from neuralocks_core.training.rig_poses import PosePool, body_around
from neuralocks_core.training.rig_report import static_report

RATE = 30.0
"""Samples of the simulations [Hz]."""
_COLLISION = 3e-5
"""Of the skinned mesh's contact [m^2/s^2] against squared errors [m^2]."""


def train_dynamic(
    rig: HairRig,
    material: RigMaterial = RigMaterial(),
    *,
    seconds: float = 75.0,
    steps: int | None = None,
    hidden: int = 32,
    seed: int = 0,
    max_angle: float = 2.4,
    clips: int = 96,
    clip_seconds: float = 4.0,
    report: bool = True,
    progress=None,
) -> RigModel:
    """Train the dynamic network of one rig.

    Args:
        rig: chains and body.
        material: constants; `damping` counts here.
        seconds: how long to regress, after the simulations; `steps`, if given, takes its place.
        hidden: width of both layers.
        seed: decides clips and first weights.
        max_angle: largest turn of one joint [rad].
        clips: how many random motions are simulated.
        clip_seconds: length of each [s].
        report: compare on held-out motion with the simulation and with spring bones.
        progress: called with (done, total, message).
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    say = progress or (lambda done, total, message: None)
    spec = rig_spec(dynamic=True)
    say(0, 1000, "simulating random motion")
    motions = [random_clip(rig.character, rng, clip_seconds, rate=RATE) for _ in range(clips)]
    features, turns = simulate_motions(rig, material, spec, motions)
    began, done, share = time.monotonic(), 0, 0.0
    pool = PosePool(rig, 256, rng)
    net = TinyNet(features.shape[-1], hidden, len(rig.chains), pool, spec, max_angle)
    flat = features.reshape(-1, features.shape[-1])
    net.mean.copy_(torch.as_tensor(flat.mean(0)))
    deviation = np.maximum(flat.std(0), 0.02)
    deviation[15:] *= 3.0  # the long history must not drown the pose
    net.scale.copy_(torch.as_tensor(1 / deviation))
    net.mean[15:] = 0
    torch.nn.init.normal_(net.layers[2].weight, std=0.02)
    energy = RigEnergy(rig, material)
    prepare_rest(energy, rig)
    with torch.no_grad():
        wanted = energy.pose(torch.as_tensor(turns.reshape(-1, len(rig.chains), 4)))[2]
    wanted = wanted.reshape(*turns.shape[:2], -1, 3)
    inputs = torch.as_tensor(features)
    optimiser = torch.optim.AdamW(net.parameters(), lr=3e-3, weight_decay=1e-3)
    batch, mean = 256, 0.0
    while share < 1:
        for group in optimiser.param_groups:
            group["lr"] = 4e-3 * min(1.0, (done + 1) / 50) * (0.5 + 0.5 * np.cos(np.pi * min(share, 1.0))) + 1e-5
        clip = torch.as_tensor(rng.integers(0, inputs.shape[0], batch))
        frame = torch.as_tensor(rng.integers(1, inputs.shape[1], batch))
        both = torch.cat([inputs[clip, frame], inputs[clip, frame - 1]])
        now, before = energy.pose(net(both))[2].chunk(2)
        true_now, true_before = wanted[clip, frame], wanted[clip, frame - 1]
        error = (now - true_now).square().sum(-1).mean()
        velocity = ((now - before) - (true_now - true_before)).square().sum(-1).mean()
        loss = error + 20 * velocity
        if pool.points is not None:
            # The simulation meets the body with a few spheres; held poses teach the skinned mesh to stay out.
            poses = rng.integers(0, pool.count, 8)
            some = torch.as_tensor(rng.choice(len(energy.chosen), min(160, len(energy.chosen)), replace=False))
            held = torch.as_tensor(pool.features(spec, poses, pool.gravity(poses)))
            rotation, position, _ = energy.pose(net(held))
            points = energy.skin(rotation, position, some)
            planes = pool.planes(poses, points.detach().numpy())
            loss = loss + _COLLISION * energy.collision(points, *map(torch.as_tensor, planes), some).mean()
        optimiser.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimiser.step()
        done += 1
        mean += 0.02 * (float(error.detach()) - mean)
        share = done / steps if steps else (time.monotonic() - began) / seconds
        if done % 25 == 0:
            say(min(int(1000 * share), 1000), 1000, f"error {1e3 * mean**0.5:.1f} mm")
    model = RigModel(
        rig.chains,
        spec,
        net.plain_layers(rig.chains.axes),
        input_limits(spec),
        max_angle,
        training={
            "method": "dynamic, regression on simulated chains",
            "steps": done,
            "seconds": round(time.monotonic() - began, 1),
            "seed": seed,
            "clips": clips,
            "hidden": hidden,
            "material": asdict(material),
        },
    )
    if report:
        say(999, 1000, "comparing on held-out motion")
        held = static_report(model, rig, material, 250, seed + 1, optimised=16)
        object.__setattr__(model, "report", held | motion_report(rig, material, {"dynamic network": model}))
    return model


def simulate_motions(rig: HairRig, material: RigMaterial, spec, motions, rate: float = RATE):
    """Features (C, T, F) and simulated turns (C, T, N, 4) of clips of equal length, sampled at `rate` [Hz]."""
    times = np.arange(int(round((motions[0].end - motions[0].start) * rate)) + 1) / rate + motions[0].start
    heads, features, bodies = [], [], []
    for motion in motions:
        joints = motion.at(times)
        heads.append(rig.character.canonical_to_world(joints))
        features.append(RigSampler(spec, rig.character, motion).features(times))
        bodies.append(body_around(rig, joints))
    body = None
    if bodies[0] is not None:
        rest = body_around(rig, rig.character.skeleton.bind[None])
        body = BodyPoints(np.stack([b[0] for b in bodies]), np.stack([b[1] for b in bodies]), rest[0][0], rest[1][0])
    solver = ChainSolver(rig.chains, RodTree(rig.chains, material), material.damping, material.weight)
    return np.stack(features), solver.simulate(np.stack(heads), 1 / rate, body)


def motion_report(rig: HairRig, material: RigMaterial, models: dict, kinds=KINDS) -> dict:
    """Held-out scripted clips: errors against the simulation of models, spring bones and hair carried rigidly.

    Returns:
        `motion_error`: rms error of the bones' ends, relative to hair carried rigidly (= 1);
            `motion_error_by_kind` the same for each kind of
        motion; `motion_ratio`: mean speed in the head's frame over the simulation's; `rates`: rms difference at
        shared times of 24 and 30 fps from 60 fps sampling of the same motion [mm].
    """
    motions = [scripted_clip(rig.character, kind, 4.0, RATE) for kind in kinds]
    _, truth = simulate_motions(rig, material, rig_spec(), motions)
    true = _ends(rig, truth)
    rest = rig.chains.origins[rig.chains.bone_joint] + rig.chains.bones
    rigid = np.broadcast_to(rest, true.shape)
    times = motions[0].start + np.arange(true.shape[1]) / RATE
    heads = np.stack([rig.character.canonical_to_world(m.at(times)) for m in motions])
    fits = [SpringSettings(s, d, g) for s in (0.3, 1.0, 2.5) for d in (0.15, 0.4) for g in (0.0, 0.6)]
    springs = [_ends(rig, spring_bones(rig.chains, heads, 1 / RATE, fit)) for fit in fits]
    best = int(np.argmin([np.square(s - true).sum(-1).mean() for s in springs]))
    candidates = {"spring bones, best of 12 settings": springs[best]}
    candidates["spring bones, VRM's defaults"] = _ends(rig, spring_bones(rig.chains, heads, 1 / RATE))
    for name, model in models.items():
        candidates[name] = np.stack([_model_ends(rig, model, m, times) for m in motions])
    error = {name: np.square(ends - true).sum(-1).mean(axis=(1, 2)) for name, ends in candidates.items()}
    carried = np.square(rigid - true).sum(-1).mean(axis=(1, 2))
    speed = np.linalg.norm(np.diff(true, axis=1), axis=-1).mean()
    result = {"motion_error": {}, "motion_error_by_kind": {}, "motion_ratio": {}, "rates": {}}
    for name, values in error.items():
        result["motion_error"][name] = round(float(np.sqrt(values.mean() / carried.mean())), 4)
        by_kind = np.sqrt(values / np.maximum(carried, 1e-12))
        result["motion_error_by_kind"][name] = {k: round(float(v), 3) for k, v in zip(kinds, by_kind)}
        ratio = np.linalg.norm(np.diff(candidates[name], axis=1), axis=-1).mean() / speed
        result["motion_ratio"][name] = round(float(ratio), 3)
    result["spring_settings"] = asdict(fits[best])
    fine = scripted_clip(rig.character, "shake", 4.0, 120.0)
    shared = np.arange(0, 4.0001, 0.5)
    for name in ["spring bones, best of 12 settings", *models]:
        result["rates"][name] = {}
        runs = {}
        for rate in (24, 30, 60):
            at = fine.start + np.arange(4 * rate + 1) / rate
            clip = type(fine)(at, fine.at(at))
            if name in models:
                runs[rate] = _model_ends(rig, models[name], clip, fine.start + shared)
            else:
                run = spring_bones(
                    rig.chains, rig.character.canonical_to_world(clip.joints)[None], 1 / rate, fits[best]
                )
                runs[rate] = _ends(rig, run)[0][(shared * rate).round().astype(int)]
        for rate in (24, 30):
            gap = np.sqrt(np.square(runs[rate] - runs[60]).sum(-1).mean())
            result["rates"][name][f"{rate} fps"] = round(1e3 * float(gap), 2)
    return result


def _model_ends(rig, model, motion, times):
    features = RigSampler(model.spec, rig.character, motion).features(times)
    return _ends(rig, model.canonical_turns(features)[None])[0]


def _ends(rig, turns):
    shape = turns.shape
    flat = quaternion_matrices(turns.reshape(-1, *shape[2:]).astype(float))
    return bone_ends(rig.chains, *pose_chains(rig.chains, flat)).reshape(*shape[:2], -1, 3)
