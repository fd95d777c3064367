# SPDX-License-Identifier: Apache-2.0
"""Options for learning from rollouts: weights of the losses, batch sizes, the kind of network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import nn

from neuralocks_core.training.muon import muon


@dataclass(frozen=True)
class RegressionOptions:
    """How rollouts are learned.

    Attributes:
        minutes: wall-clock budget; `steps` takes precedence.
        steps: number of steps; a run is then repeatable on one machine with the same number of threads, whatever its load.
        clips: rollouts per step.
        moments: pairs of consecutive frames from each rollout.
        strands: strands from each rollout.
        rate: first step size, falling along a cosine.
        optimiser: "muon" for the weight matrices (AdamW for the rest), or "adamw" for all.
        position: weight of the position error, in strand lengths.
        velocity: weight of the error of frame differences, in strand lengths.
        swing: weight of the error about its mean over a strand's moments, relative to the strand's own motion.
        settling: weight of the error of frame differences, relative to the strand's own frame difference.
        parting: weight of the error about its mean over the strands of a lock, relative to how far these part.
        bending: weight of the error of the difference between successive edges, in edge lengths.
        collision: weight of the depth under the target's body plane, in strand lengths.
        mirror: share of the rollouts of a step that are mirrored.
        output: "direction" or "displacement".
        motion: "linear", "encoder" or "modulated", see StrandNet.
        strand_map: "linear" or "deep", see StrandNet.
        static: learn without history (the quasi-static variant, and the baseline of equal budget).
        seed: random seed of weights and batches.
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
    """The network's output for the bind pose is subtracted."""

    def optimisers(self, net: nn.Module) -> list[torch.optim.Optimizer]:
        """The optimisers for `net`."""
        if self.optimiser == "adamw":
            return [torch.optim.AdamW(net.parameters(), lr=self.rate, weight_decay=1e-4)]
        return muon(net, self.rate, 1e-4)
