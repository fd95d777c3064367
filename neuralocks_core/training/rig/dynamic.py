# SPDX-License-Identifier: Apache-2.0
"""Training the dynamic variant of a rig's network: regression on simulations of its chains under random motion.

The network stays a pure function of the boundary history; it learns to give the simulation's result after the same
history.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch

from neuralocks_core.animation.random_motion import random_clip
from neuralocks_core.progress import Progress, silent, within
from neuralocks_core.rig.network import RigModel, rig_spec
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.training.data.rollouts import STOPS
from neuralocks_core.training.descent import Descended
from neuralocks_core.training.rig.contact import HairOnBodies, contact_weight
from neuralocks_core.training.rig.deepest import LATE, DeepestPoses
from neuralocks_core.training.rig.energy import RigEnergy
from neuralocks_core.training.rig.learning import trained
from neuralocks_core.training.rig.motion import RATE, motion_report, simulate_motions
from neuralocks_core.training.rig.network import TinyNet
from neuralocks_core.training.rig.poses import Moments
from neuralocks_core.training.rig.report import static_report
from neuralocks_core.training.threads import threads

_VELOCITY = 20.0
"""Weight of squared errors of the motion from one sample to the next, relative to squared errors of positions."""
_BESIDE = 0.02
"""Offset of points beside a bone's end [m], which show its turn: from ends alone, networks learn that twist does not matter."""
_COLLISION, _HELD_COLLISION, _HELD_ELASTIC = 1.5e-4, 2e-4, 2e-3
"""Weights of the skinned mesh's contact in motion and in held poses, and of gravity and bending in held poses [m^2/s^2], relative
to squared errors [m^2]. Clips hold few of the poses that necks can take; energy needs no clip."""
_DEEP = 3.0
"""Contact in a held pose counts by its logarithm beyond this energy [m^2/s^2]: otherwise the few poses in which a lock would be
deepest outweigh all those in which it would hang, and it stands out from the head in all of them."""
_DEEPEST, _DEEPEST_MOVING = 2e-4, 4e-5
"""Weights of contact in the held poses and in the moments of motion in which hair lies deepest. As much in motion as in held poses
costs a tenth of the motion."""
_POOL = 256
"""Number of bodies held ready, and as many in motion."""
_HELD, _MOVING, _WORST = 16, 8, 8
"""Bodies in held poses, in motion, and in the poses in which hair lies deepest, whose contact counts in a step."""
_CLIP_TAKES, _POSING_TAKES, _STEP_TAKES, _REPORT_TAKES = 0.5, 8.0, 0.03, 40.0
"""Approximate time that each takes [s], for even progress."""
_MOMENTS = 16
"""Moments of each simulated motion, from which the bodies in motion are drawn."""
_WILD = 0.0
"""Share of clips that spin or tumble: such a small network learns them at the cost of all other motion."""
_ROOM, _HELD_ROOM = 0.006, 0.012
"""Kept from the body beyond the material's margin while learning, in motion and in held poses [m]: the network is not exact to the
millimetre, and held poses and body shapes are farther apart than those in motion."""


@threads(1)
def train_dynamic(
    rig: HairRig,
    material: RigMaterial = RigMaterial(),
    *,
    seconds: float = 120.0,
    steps: int | None = None,
    hidden: int = 32,
    seed: int = 0,
    clips: int = 256,
    clip_seconds: float = 4.0,
    batch: int = 256,
    report_poses: int = 1000,
    begin: RigModel | None = None,
    keep: Callable[[RigModel], None] | None = None,
    progress: Progress | None = None,
) -> RigModel:
    """Train the dynamic network of one rig.

    Args:
        rig: chains and body.
        material: constants; `damping` counts here.
        seconds: time for the regression, after the simulations.
        steps: of the regression, in place of its time.
        hidden: width of both layers, unless `begin` decides it.
        seed: decides clips and initial weights.
        clips: number of random motions to simulate.
        clip_seconds: length of each [s].
        batch: pairs of consecutive samples per step.
        report_poses: held-out poses of the report, which also compares with spring bones in motion; 0 leaves it out.
        begin: a dynamic model of the same chains to train on: with smaller steps, and contact counts fully from the first.
        keep: called with the model before its report is measured.
        progress: called with (done, total, message); may raise to stop.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    say = progress or silent
    spec = rig_spec(dynamic=True)
    simulating, learning = _CLIP_TAKES * clips, seconds if steps is None else _STEP_TAKES * steps
    ends = np.cumsum([simulating, _POSING_TAKES, learning, _REPORT_TAKES])
    simulated, posed, learned = (1000 * ends[:3] / ends[3]).astype(int).tolist()
    features, turns, moments = _simulated(rig, material, spec, clips, clip_seconds, rng, within(say, 0, simulated))
    say(simulated, 1000, "posing bodies")
    held = HairOnBodies(rig, _roomy(material, _HELD_ROOM), _POOL, rng, spec)
    moving = HairOnBodies(rig, _roomy(material, _ROOM), _POOL, rng, spec, moments)
    if held.pool.collides:
        deepest = DeepestPoses(rig, _roomy(material, _HELD_ROOM), *rng.spawn(1), spec)
        deepest_moving = DeepestPoses(rig, _roomy(material, _ROOM), *rng.spawn(1), spec, moments)
    inputs, wanted = torch.as_tensor(features), torch.as_tensor(turns)
    net = TinyNet(begin.hidden if begin else hidden, held.pool, spec)
    net.normalise(features.reshape(-1, features.shape[-1]))

    def losses(done: float) -> dict[str, torch.Tensor]:
        clip = torch.as_tensor(rng.integers(0, inputs.shape[0], batch))
        frame = torch.as_tensor(rng.integers(1, inputs.shape[1], batch))
        both = torch.cat([inputs[clip, frame], inputs[clip, frame - 1]])
        with torch.no_grad():
            there = _marks(held.energy, torch.cat([wanted[clip, frame], wanted[clip, frame - 1]]))
        now, before = (_marks(held.energy, net(both)) - there).chunk(2)
        result = {
            "place": now.square().sum(-1).mean(),
            "motion": _VELOCITY * (now - before).square().sum(-1).mean(),
        }
        if held.pool.collides:
            # Near the body a small error may be a deep one, which squared errors do not show.
            elastic, collision = held.parts(net, _HELD)
            stage = 1.0 if begin else done
            felt = contact_weight(stage)
            result["held"] = felt * _HELD_COLLISION * _bounded(collision).mean() + _HELD_ELASTIC * elastic.mean()
            result["moving"] = felt * _COLLISION * moving.parts(net, _MOVING)[1].mean()
            if stage >= LATE:
                result["deepest"] = _DEEPEST * _bounded(deepest.contact(net, _WORST)).mean()
                result["deepest moving"] = _DEEPEST_MOVING * deepest_moving.contact(net, _WORST).mean()
        return result

    def show(state: Descended) -> None:
        far = posed + int((learned - posed) * state.done)
        say(far, 1000, f"error {1e3 * state.losses['place'] ** 0.5:.1f} mm")

    settings = {"seed": seed, "clips": clips, "clip_seconds": clip_seconds, "batch": batch}
    model = trained(
        net, losses, seconds=seconds, steps=steps, begin=begin, decay=0.1, chains=rig.chains, material=material,
        method="dynamic, regression on simulated chains", settings=settings, show=show, keep=keep,
    )  # fmt: skip
    if report_poses:
        middle = (learned + 1000) // 2
        held_poses, in_motion = within(say, learned, middle), within(say, middle, 1000)
        model.report.update(static_report(model, rig, material, report_poses, seed + 1, held_poses))
        model.report.update(motion_report(rig, material, {"dynamic network": model}, progress=in_motion))
        say(1000, 1000, "report done")
    return model


def _roomy(material: RigMaterial, room: float) -> RigMaterial:
    return replace(material, margin=material.margin + room)


def _bounded(collision: torch.Tensor) -> torch.Tensor:
    return _DEEP * torch.log1p(collision / _DEEP)


def _marks(energy: RigEnergy, turns: torch.Tensor) -> torch.Tensor:
    """Bones' ends, and points _BESIDE them in three directions minus the ends, (B, M, 12) [m], of turns (B, N, 4)."""
    rotations, _, ends = energy.pose(turns)
    beside = _BESIDE * rotations[:, energy.bone_joint]
    return torch.cat([ends, beside.flatten(-2)], dim=-1)


def _simulated(rig, material, spec, clips, seconds, rng, say) -> tuple[np.ndarray, np.ndarray, Moments]:
    """Features (C, T, F) and turns (C, T, N, 4) of random motions, a few at a time so that progress can be reported; and
    some moments of each.
    """
    parts, read, posed = [], [], []
    for first in range(0, clips, 16):
        say(first, clips, f"simulating motion, {first} of {clips} clips")
        few = [
            random_clip(rig.character, rng, seconds, rate=RATE, wild=_WILD, stops=STOPS)
            for _ in range(min(16, clips - first))
        ]
        parts.append(simulate_motions(rig, material, spec, few))
        for motion, features in zip(few, parts[-1][0]):
            samples = rng.choice(len(features), min(_MOMENTS, len(features)), replace=False)
            read.append(features[samples])
            posed.append(motion.at(motion.start + samples / RATE) @ rig.character.inverse_bind)
    features, turns = zip(*parts)
    return np.concatenate(features), np.concatenate(turns), Moments(np.concatenate(read), np.concatenate(posed))
