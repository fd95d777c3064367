# SPDX-License-Identifier: Apache-2.0
"""The situations in which hair lies deepest in the body, searched among thousands while a network learns."""

import numpy as np
import torch

from neuralocks_core.rig.network import POSE, feature_columns
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.training.rig.energy import RigEnergy
from neuralocks_core.training.rig.poses import Moments, PosePool

SEARCHED, KEPT = 2048, 128
"""Poses that are searched, and those of them that are learned from until the next search."""
MEMORY = 250_000_000
"""[bytes] for the poses: of bodies with more vertices around the head than the example's, fewer are searched."""
EVERY, RENEWED = 150, 512
"""Steps from one search to the next, and poses that are replaced before it."""
LATE = 0.75
"""Share of the budget after which they count in a training that begins with nothing, when hair hangs and steps are small: from
the start, with weights that clear the body, they push locks far off it."""
_TOGETHER = 64


class DeepestPoses:
    """Poses and bodies, and the contact of hair in the worst of them.

    Where hair lies in the body, one pose in hundreds is the deepest, and the poses of a training step hold none like it.

    Args:
        rig: chains, hair vertices and body.
        material: constants of the contact.
        rng: decides poses and bodies.
        spec: the network's inputs.
        moments: of motion to draw the poses from; held poses of random necks if left out.
        searched: number of poses, fewer if they would take more than MEMORY.
    """

    def __init__(
        self,
        rig: HairRig,
        material: RigMaterial,
        rng: np.random.Generator,
        spec,
        moments: Moments | None = None,
        searched: int = SEARCHED,
    ):
        searched = min(searched, max(2 * KEPT, MEMORY // PosePool.size(rig)))
        self._pool, self._energy = PosePool(rig, searched, rng, moments), RigEnergy(rig, material)
        self._rng, self._spec, self._taken = rng, spec, 0
        self._features = np.empty((searched, len(feature_columns(spec))), np.float32)
        self._read(np.arange(searched))

    def contact(self, net: torch.nn.Module, batch: int) -> torch.Tensor:
        """Collision energy (batch,) [m^2/s^2] of a network's outputs in some of the poses in which hair was deepest."""
        if self._taken % EVERY == 0:
            self._search(net)
        self._taken += 1
        rows = self._rng.choice(self._worst, min(batch, len(self._worst)), replace=False)
        return self._energy.parts(self._pool, rows, self._turns(net, rows), self._features[rows, POSE - 3 : POSE])[1]

    @torch.no_grad()
    def _search(self, net) -> None:
        if self._taken:
            self._read(self._pool.renew(min(RENEWED, self._pool.count // 4)))
        rows = np.arange(self._pool.count)
        some = np.array_split(rows, -(-len(rows) // _TOGETHER))
        depths = [self._energy.depths(self._pool, few, self._turns(net, few)) for few in some]
        self._worst = np.argsort(-np.concatenate(depths), kind="stable")[:KEPT]

    def _turns(self, net, rows: np.ndarray) -> torch.Tensor:
        return net(torch.as_tensor(self._features[rows]))

    def _read(self, rows: np.ndarray) -> None:
        self._features[rows] = self._pool.situations(self._spec, rows)
