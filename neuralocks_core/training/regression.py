# SPDX-License-Identifier: Apache-2.0
"""Training on rollouts of our own solver: positions, frame differences and the body they must stay out of.

The paper's detached inertia term (its section 3.4.5) is an iteration that diverges for weakly damped hair; here each
step is pulled to where the converged solver went instead. `selfsupervised.py` has the paper's way.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from neuralocks_core.deformation.strand_session import strand_inputs
from neuralocks_core.materials import MARGIN, NO_PLANE
from neuralocks_core.network_sizes import K
from neuralocks_core.strands.strand_set import StrandSet
from neuralocks_core.training.descent import Descended, Schedule, descend
from neuralocks_core.training.farm import load
from neuralocks_core.training.mirror import POLAR, mirrored_strands, mirrored_vectors
from neuralocks_core.training.muon import muon
from neuralocks_core.training.networks import StrandNet, deform
from neuralocks_core.training.rollouts import STEP, Rollout, TrainingScene

STILL = 0.01
"""Motion, in strand lengths, below which a strand counts as standing."""
CREEP = 0.002
"""Motion from frame to frame, in strand lengths, below which a strand hardly moves."""
TOGETHER = 0.003
"""Distance, in strand lengths, below which the hairs of a lock count as one."""


@dataclass(frozen=True)
class RegressionOptions:
    """How rollouts are learned.

    Attributes:
        minutes: wall-clock budget; `steps` wins where it is given.
        steps: number of steps; a run is then repeatable on one machine with one number of threads, whatever else it does.
        clips: rollouts in a step.
        moments: pairs of consecutive frames from each.
        strands: strands from each.
        rate: first step size, falling along a cosine.
        optimiser: "muon" for the weight matrices (AdamW for the rest), or "adamw" for all.
        position: weight of the position error, in strand lengths.
        velocity: weight of the error of frame differences, in strand lengths.
        swing: weight of the error about its mean over a strand's moments, relative to the strand's own motion.
        settling: weight of the error of frame differences, relative to the strand's own frame difference.
        parting: weight of the error about its mean over the strands of a lock, relative to how far these part.
        bending: weight of the error of the difference between successive edges, in edge lengths.
        collision: weight of the depth under the target's body plane, in strand lengths.
        mirror: share of the rollouts of a step that are seen in a mirror.
        output: "direction" or "displacement".
        motion: "linear", "encoder" or "modulated", see StrandNet.
        strand_map: "linear" or "deep", see StrandNet.
        static: learn without history (the quasi-static variant, and the baseline of equal budget).
        seed: of weights and batches.
        device: torch device.
    """

    minutes: float = 10.0
    steps: int | None = None
    clips: int = 48
    moments: int = 4
    strands: int = 8
    rate: float = 2e-3
    optimiser: str = "muon"
    position: float = 3.0
    velocity: float = 6.0
    swing: float = 0.4
    settling: float = 0.3
    parting: float = 0.3
    bending: float = 0.0
    collision: float = 45.0
    mirror: float = 0.0
    output: str = "direction"
    motion: str = "modulated"
    strand_map: str = "deep"
    static: bool = False
    seed: int = 0
    device: str = "cpu"

    anchored: ClassVar[bool] = True
    """The network's answer for the bind pose is taken off."""

    def optimisers(self, net: nn.Module) -> list[torch.optim.Optimizer]:
        """What trains `net`."""
        if self.optimiser == "adamw":
            return [torch.optim.AdamW(net.parameters(), lr=self.rate, weight_decay=1e-4)]
        return muon(net, self.rate, 1e-4)


class RolloutBank:
    """Rollouts in memory, with what the network reads of their strands.

    Args:
        scene: the one that the rollouts were made from.
        codes: gives latent codes (S, 32) of strands.
    """

    def __init__(self, scene: TrainingScene, codes: Callable[[StrandSet], np.ndarray]):
        self._scene, self._codes = scene, codes
        self.inputs = [strand_inputs(groom, codes(groom)) for groom in scene.grooms]
        self.lengths = [groom.length for groom in scene.grooms]
        self.rollouts: list[Rollout] = []
        self.material = scene.spec.slices["material"]
        self._seen: set[Path] = set()

    @cached_property
    def _mirrored(self) -> list[np.ndarray]:
        """As `inputs`, of the grooms seen in a mirror."""
        return [strand_inputs(groom, self._codes(groom)) for groom in map(mirrored_strands, self._scene.grooms)]

    def add(self, files: list[Path]) -> None:
        """Read the files that are new."""
        for path in files:
            if path not in self._seen:
                self._seen.add(path)
                self.rollouts.append(load(path))

    @staticmethod
    def _alike(rollout: Rollout, rng: np.random.Generator, count: int) -> np.ndarray:
        """Random strands of one material, which each lock has its own of: they share the frame's part of the first layer,
        and how they part from each other can be compared.
        """
        same = rollout.materials == rollout.materials[rng.integers(len(rollout.strands))]
        strands = np.flatnonzero(same.all(axis=1))
        return rng.choice(strands, count, replace=len(strands) < count)

    def batch(self, rng: np.random.Generator, options: RegressionOptions) -> dict[str, Tensor]:
        """A training step's tensors: M rollouts, n strands, 2 moments of consecutive frames and the anchor's vector
        last.
        """
        rows: dict[str, list] = {name: [] for name in ("strands", "rest", "length", "frames", "moved", "planes")}
        for index in rng.integers(len(self.rollouts), size=options.clips):
            rollout = self.rollouts[index]
            pick = self._alike(rollout, rng, options.strands)
            late = rng.integers(max(rollout.first, 1), len(rollout.vectors), size=options.moments)
            moments = np.stack([late - 1, late], axis=1).ravel()
            chosen = rollout.strands[pick]
            frames = np.concatenate([rollout.vectors[moments], rollout.bind[None]])
            frames[:, self.material] = rollout.materials[pick[0]]
            inputs, sides = self.inputs, np.ones(3, np.float32)
            if options.mirror and rng.random() < options.mirror:
                inputs, sides, frames = self._mirrored, POLAR, mirrored_vectors(self._scene.spec, frames)
            rows["strands"].append(inputs[rollout.groom][chosen])
            rows["rest"].append(rollout.rest[pick] * sides)
            rows["length"].append(self.lengths[rollout.groom][chosen])
            rows["frames"].append(frames)
            rows["moved"].append(rollout.moved[moments[:, None], pick] * sides)
            rows["planes"].append(rollout.planes[moments[:, None], pick] * np.append(sides, 1))
        batch = {name: torch.from_numpy(np.stack(values)).to(options.device) for name, values in rows.items()}
        batch["moved"] = batch["moved"].float() * STEP
        batch["planes"] = batch["planes"].float()
        return batch


def regress(
    bank: RolloutBank,
    net: StrandNet,
    options: RegressionOptions,
    optimisers: list[torch.optim.Optimizer],
    new_files: Callable[[], list[Path]],
    *,
    at_step: Callable[[int], list[Path]] | None = None,
    step: int = 0,
    done: float = 0.0,
) -> Iterator[Descended]:
    """Train `net` in place; yields what a caller may show, measure or save about every second.

    Args:
        bank: holds rollouts already; grows by what `new_files` gives.
        net: normalised, on `options.device`.
        options: budget and settings.
        optimisers: `options.optimisers(net)`, or what a checkpoint made of them.
        new_files: the rollouts on disk by now.
        at_step: the rollouts for a step; asked in place of `new_files`, before each, where `options.steps` is given.
        step, done: where an earlier run stopped.
    """
    net.train()
    rng = np.random.default_rng([options.seed, step])

    counted = at_step if options.steps else None

    def losses(done: float) -> dict[str, Tensor]:
        if counted:
            bank.add(counted(round(done * options.steps)))
        return regression_losses(net, bank.batch(rng, options), options)

    schedule = Schedule(options.minutes, options.steps, options.rate)
    for state in descend(optimisers, losses, schedule, step=step, done=done):
        if not counted:
            bank.add(new_files())
        yield state
    net.eval()


def regression_losses(net: StrandNet, batch: dict[str, Tensor], options: RegressionOptions) -> dict[str, Tensor]:
    """Weighted losses of a batch, each a mean in units of strand length, `swing`, `settling` and `parting` ratios.

    `position` |x - x*|, `velocity` the same of frame differences, `swing` how wrong a strand's motion is relative to
    that motion, so that small motion counts as much as large, `settling` the same of one frame difference, so that hair
    comes to rest when it should, `parting` how wrong it is which way the strands of a lock part, relative to how far
    they do, `bending` how wrong the hair is bent from edge to edge, so that it does not crinkle, `collision` how far x lies
    under the plane of the body next to x*, beyond where x* itself lies or MARGIN, whichever is nearer the body.

    Args:
        net: the network.
        batch: what `RolloutBank.batch` gives.
        options: weights, and what the network's output stands for.
    """
    strands, moments = net.strand_part(batch["strands"]), net.frame_part(batch["frames"])
    offsets = net.tail(strands[:, None], moments[:, :, None])
    offsets = offsets.unflatten(-1, (K, 3))
    moved = deform(offsets[:, :-1], batch["rest"][:, None], offsets[:, -1:], options.output)
    error = moved - batch["moved"]
    length = batch["length"][:, None, :, None]
    position = _norm(error) / length
    pairs = error.unflatten(1, (-1, 2))
    late = pairs[:, :, 1] - pairs[:, :, 0]
    velocity = _norm(late) / length
    squared = batch["length"].square()
    true = batch["moved"].unflatten(1, (-1, 2))
    true_late = (true[:, :, 1] - true[:, :, 0]).square().sum(-1).mean(-1) + CREEP**2 * squared[:, None]
    settling = (late.square().sum(-1).mean(-1) / true_late + 1e-6).sqrt()
    true_swing = _spread(batch["moved"], 1).mean((1, 3)) + STILL**2 * squared
    swing = (_spread(error, 1).mean((1, 3)) / true_swing + 1e-6).sqrt()  # smooth at zero
    true_parting = _spread(batch["moved"], 2).mean((1, 2, 3)) + TOGETHER**2 * squared.mean(1)
    parting = (_spread(error, 2).mean((1, 2, 3)) / true_parting + 1e-6).sqrt()
    edge = length / (K - 1)
    bending = _norm(torch.diff(error, n=2, dim=-2) / edge[..., None])
    normals, offset = batch["planes"][..., :3], batch["planes"][..., 3]
    target = (normals * batch["moved"]).sum(-1) - offset
    depth = torch.relu(target.clamp_max(MARGIN) - (normals * moved).sum(-1) + offset)
    depth = torch.where(offset > NO_PLANE[3] / 10, depth, torch.zeros_like(depth))
    return {
        "position": options.position * position.mean(),
        "velocity": options.velocity * velocity.mean(),
        "swing": options.swing * swing.mean(),
        "settling": options.settling * settling.mean(),
        "parting": options.parting * parting.mean(),
        "bending": options.bending * bending.mean(),
        "collision": options.collision * (depth / length).mean(),
    }


@torch.no_grad()
def predicted(net: StrandNet, bank: RolloutBank, rollout: Rollout, output: str, anchored: bool) -> np.ndarray:
    """The network's displacement (T, n, 24, 3) float32 [m] over a whole rollout.

    Args:
        net: the network.
        bank: where the rollout's strand inputs are.
        rollout: whose strands, frames and materials.
        output, anchored: see `networks.deform`; not anchored, the bind pose's own answer stays in.
    """
    chosen = rollout.strands
    device = next(net.parameters()).device
    strands = net.strand_part(torch.from_numpy(bank.inputs[rollout.groom][chosen]).to(device))
    frames = np.concatenate([rollout.vectors, rollout.bind[None]])
    result = np.empty((len(rollout.vectors), len(chosen), K, 3), np.float32)
    kinds, kind = np.unique(rollout.materials, axis=0, return_inverse=True)
    for i, material in enumerate(kinds):
        group = np.flatnonzero(kind.ravel() == i)
        frames[:, bank.material] = material
        offsets = net.tail(strands[None, group], net.frame_part(torch.from_numpy(frames).to(device))[:, None])
        offsets = offsets.unflatten(-1, (K, 3))
        rest = torch.from_numpy(rollout.rest[group]).to(device)
        anchor = offsets[-1:] if anchored else None
        result[:, group] = deform(offsets[:-1], rest, anchor, output).cpu().numpy()
    return result


def _spread(vectors: Tensor, axis: int) -> Tensor:
    """Squared distance (M, moments, n, 24) of (M, moments, n, 24, 3) from its mean over an axis."""
    return (vectors - vectors.mean(axis, keepdim=True)).square().sum(-1)


def _norm(vectors: Tensor) -> Tensor:
    # Smooth at zero: a tenth of a millimetre.
    return vectors.square().sum(-1).add(1e-8).sqrt()
