# SPDX-License-Identifier: Apache-2.0
"""Options of self-supervised training: the paper's and ours."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from neuralocks_core.physics.bend_twist import Cosserat


@dataclass(frozen=True)
class SelfSupervisedOptions:
    """How moments are learned.

    Attributes:
        minutes: wall-clock budget; `steps` takes precedence.
        steps: number of steps, for reproducible runs.
        poses: moments per step; the paper has one.
        strands: strands per moment, in whole locks.
        pool: moments kept in the pool.
        rate: Adam's first step size, falling along a cosine.
        output: "direction" or, as in the paper, "displacement".
        motion: "linear", "encoder" or "modulated", see StrandNet.
        strand_map: "linear" or "deep", see StrandNet.
        static: the quasi-static variant: no history, no inertia.
        undetached: weight of a second inertia term whose past is not detached. With 0, the paper's detached term alone
            diverges for long, weakly damped hair; this one damps fast swings.
        warmup: share of the budget trained without inertia; it then rises over another tenth.
        form: how bending is measured; the paper's is `DIRECT`.
        supported: the groom carries its own weight in the bind pose, and the network's answer there is subtracted.
        random_materials: draw the four material constants for each moment; else the default ones.
        damping: damping of the default material [1/s] if materials are not random; the paper has none.
        adhesion: factor on the stiffness of the ties between neighbours; 0 leaves them out.
        paper_adhesion: adhesion to the nearest vertices, without rest offset.
        style: stiffness of the hair style potential per groom [1/s^2]; the last value holds for all further grooms.
        volume: stiffness of self-collision [m^2/s^2]; measured on a quarter of the poses, which is enough.
        seed: random seed of weights and batches.
        device: torch device.
    """

    minutes: float = 10.0
    steps: int | None = None
    poses: int = 16
    strands: int = 16
    pool: int = 3000
    rate: float = 1e-3
    output: str = "direction"
    motion: str = "linear"
    strand_map: str = "linear"
    static: bool = False
    undetached: float = 8.0
    warmup: float = 0.2
    form: Cosserat = Cosserat.EXACT
    supported: bool = True
    random_materials: bool = True
    damping: float = 10.0
    adhesion: float = 1.0
    paper_adhesion: bool = False
    style: tuple[float, ...] = (0.0,)
    volume: float = 0.3
    seed: int = 0
    device: str = "cpu"

    def optimisers(self, net: torch.nn.Module) -> list[torch.optim.Optimizer]:
        """The optimisers for `net`."""
        return [torch.optim.Adam(net.parameters(), lr=self.rate)]

    @property
    def anchored(self) -> bool:
        """Whether the network's output for the bind pose is subtracted."""
        return self.supported

    @classmethod
    def paper(cls, **changes) -> SelfSupervisedOptions:
        """The paper's choices of network, inertia, bending, adhesion, damping and materials, with `changes` applied;
        `docs/deviations.md` lists what else differs.
        """
        settings = {
            "output": "displacement",
            "undetached": 0.0,
            "warmup": 0.0,
            "form": Cosserat.DIRECT,
            "supported": False,
            "random_materials": False,
            "damping": 0.0,
            "paper_adhesion": True,
        }
        return cls(**{**settings, **changes})
