# SPDX-License-Identifier: Apache-2.0
"""The live gauge: has the network learned gravity and motion yet?

The loss cannot tell: it is small even for rigid hair. The gauge compares the network with the solver on motion and
strands that training never sees, beside hair carried rigidly (= 1) and the network's own output for each pose held
still.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np

from neuralocks_core.metrics import swings
from neuralocks_core.training.learning.regression import RolloutBank, predicted
from neuralocks_core.training.networks import StrandNet


@dataclass(frozen=True)
class Gauge:
    """Means over held-out strands and frames.

    Attributes:
        position: error of a vertex in percent of strand length.
        rigid: the same for hair carried rigidly.
        static: the same for the network's own output for the pose held still.
        motion: error of the motion about its mean, rms over a strand relative to rigid (= 1), median over strands.
        motion_static: the same for the held pose's output.
        motion_ratio: length of the frame differences, relative to the solver's.
        droop: distance from rest, relative to the solver's.
        velocity: rms error of the frame differences, relative to their own rms.
        penetration: share of vertices deeper than 1 mm under the body plane nearest to the solver's vertex, percent.
    """

    position: float
    rigid: float
    static: float
    motion: float
    motion_static: float
    motion_ratio: float
    droop: float
    velocity: float
    penetration: float

    def __str__(self) -> str:
        return (
            f"motion error {self.motion:.2f} (rigid 1, held pose {self.motion_static:.2f}), "
            f"motion {self.motion_ratio:.0%} and droop {self.droop:.0%} of the solver's, "
            f"position {self.position:.1f} % of length (rigid {self.rigid:.1f})"
        )

    def to_json(self) -> dict:
        """Plain numbers, rounded."""
        return {name: round(value, 4) for name, value in asdict(self).items()}


def measure(
    net: StrandNet,
    bank: RolloutBank,
    output: str,
    history: slice,
    anchored: bool,
) -> Gauge:
    """Compare the network with all rollouts of a held-out bank.

    Args:
        net: the network.
        bank: rollouts that it never saw.
        output: see `networks.deform`.
        history: where the history lies in the boundary vector.
        anchored: whether its output for the held bind pose is subtracted.
    """
    sums = {name: [] for name in ("position", "rigid", "static")}
    motion, motion_static, speeds, ways, wrong, deep = [], [], [], [], [], []
    for rollout in bank.rollouts:
        target = rollout.moved[rollout.first :].astype(np.float32) * rollout.step
        length = bank.lengths[rollout.groom][rollout.strands][:, None]
        answer = predicted(net, bank, rollout, output, anchored)[rollout.first :]
        held = rollout.vectors.copy()
        held[:, history] = 0
        still = predicted(net, bank, replace(rollout, vectors=held), output, anchored)[rollout.first :]
        for name, error in (("position", answer - target), ("rigid", target), ("static", still - target)):
            sums[name].append(100 * (np.linalg.norm(error, axis=-1) / length).mean())
        for ratios, moved in ((motion, answer), (motion_static, still)):
            ratios.append(np.divide(*swings(moved, target, length[:, 0])))
        steps, true_steps = np.diff(answer, axis=0), np.diff(target, axis=0)
        speeds.append([np.linalg.norm(steps, axis=-1).mean(), np.linalg.norm(true_steps, axis=-1).mean()])
        ways.append([np.linalg.norm(answer, axis=-1).mean(), np.linalg.norm(target, axis=-1).mean()])
        wrong.append([np.square(steps - true_steps).mean(), np.square(true_steps).mean()])
        planes = rollout.planes[rollout.first :].astype(np.float32)
        distance = (planes[..., :3] * answer).sum(-1) - planes[..., 3]
        before = np.minimum((planes[..., :3] * target).sum(-1) - planes[..., 3], 0)
        deep.append(100 * (distance < before - 1e-3).mean())
    speeds, ways, wrong = (np.sum(values, axis=0) for values in (speeds, ways, wrong))
    motion, motion_static = (np.concatenate(ratios) for ratios in (motion, motion_static))
    return Gauge(
        position=float(np.mean(sums["position"])),
        rigid=float(np.mean(sums["rigid"])),
        static=float(np.mean(sums["static"])),
        motion=float(np.median(motion)) if len(motion) else 1.0,
        motion_static=float(np.median(motion_static)) if len(motion) else 1.0,
        motion_ratio=float(speeds[0] / max(speeds[1], 1e-12)),
        droop=float(ways[0] / max(ways[1], 1e-12)),
        velocity=float(np.sqrt(wrong[0] / max(wrong[1], 1e-20))),
        penetration=float(np.mean(deep)),
    )
