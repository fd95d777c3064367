# SPDX-License-Identifier: Apache-2.0
"""Training on rollouts of our own solver: positions, frame differences and collisions with the body.

The paper's detached inertia term (its section 3.4.5) is an iteration that diverges for weakly damped hair; here each
step is pulled to the converged solver's result instead. `selfsupervised.py` has the paper's method.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from neuralocks_core.deformation.strand_session import strand_inputs
from neuralocks_core.models.network_sizes import K
from neuralocks_core.strands.strand_set import StrandSet
from neuralocks_core.training.data.farm import load
from neuralocks_core.training.data.mirror import POLAR, mirrored_strands, mirrored_vectors
from neuralocks_core.training.data.rollouts import Rollout, TrainingScene
from neuralocks_core.training.descent import Descended, Schedule, descend
from neuralocks_core.training.learning.regression_losses import regression_losses
from neuralocks_core.training.learning.regression_options import RegressionOptions
from neuralocks_core.training.networks import StrandNet, deform

FIRST = 24
"""Clips to wait for before training of the network starts: enough to normalise its inputs."""
MOST = 1200
"""Rollouts in memory, of 2.4 MB each, and on disk, besides those that have been made and not read yet."""


class RolloutBank:
    """Rollouts in memory, with the network's inputs from their strands. Of more than MOST, the FIRST and the latest stay.

    Args:
        scene: the one that the rollouts were made from.
        codes: function that gives the latent codes (S, 32) of strands.
    """

    def __init__(self, scene: TrainingScene, codes: Callable[[StrandSet], np.ndarray]):
        self._scene, self._codes = scene, codes
        self.inputs = [strand_inputs(groom, codes(groom)) for groom in scene.grooms]
        self.lengths = [groom.length for groom in scene.grooms]
        self.rollouts: list[Rollout] = []
        self.material = scene.spec.slices["material"]
        self._files: list[Path] = []
        self._seen: set[Path] = set()

    @cached_property
    def _mirrored(self) -> list[np.ndarray]:
        """Like `inputs`, for the grooms seen in a mirror."""
        return [strand_inputs(groom, self._codes(groom)) for groom in map(mirrored_strands, self._scene.grooms)]

    @property
    def read(self) -> int:
        """How many rollouts it has had so far."""
        return len(self._seen)

    def add(self, files: list[Path]) -> None:
        """Read the files that are new; those of rollouts that they replace are emptied, and stay as a sign that they were there."""
        for path in files:
            if path in self._seen:
                continue
            self._seen.add(path)
            if not path.stat().st_size:  # emptied before training was resumed
                continue
            self._files.append(path)
            self.rollouts.append(load(path, self._scene))
            if len(self.rollouts) > MOST:
                del self.rollouts[FIRST]
                with suppress(OSError):  # then it stays, and takes up space
                    self._files.pop(FIRST).write_bytes(b"")

    @staticmethod
    def _alike(rollout: Rollout, rng: np.random.Generator, count: int) -> np.ndarray:
        """Random strands of one material (each lock has a material of its own): they share the frame's part of the first layer, and
        how they part from each other can be compared.
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
            rows["moved"].append(rollout.moved[moments[:, None], pick] * (sides * np.float32(rollout.step)))
            rows["planes"].append(rollout.planes[moments[:, None], pick] * np.append(sides, 1))
        batch = {name: torch.from_numpy(np.stack(values)).to(options.device) for name, values in rows.items()}
        for name in ("moved", "planes"):
            batch[name] = batch[name].float()
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
    """Train `net` in place; yields about every second, for a caller to display, measure or save.

    Args:
        bank: already holds rollouts; grows by the files of `new_files`.
        net: normalised, on `options.device`.
        options: budget and settings.
        optimisers: `options.optimisers(net)`, or as restored from a checkpoint.
        new_files: returns the rollouts on disk by now.
        at_step: returns the new rollouts for a step; called before each step in place of `new_files` if `options.steps` is given.
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


@torch.no_grad()
def predicted(net: StrandNet, bank: RolloutBank, rollout: Rollout, output: str, anchored: bool) -> np.ndarray:
    """The network's displacement (T, n, 24, 3) float32 [m] over a whole rollout.

    Args:
        net: the network.
        bank: has the rollout's strand inputs.
        rollout: gives strands, frames and materials.
        output, anchored: see `networks.deform`; if not anchored, the bind pose's own output stays in.
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
