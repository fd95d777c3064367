# SPDX-License-Identifier: Apache-2.0
"""Bodies in poses or in motion to learn from, renewed continually, and the loss of hair that collides with them."""

import numpy as np
import torch

from neuralocks_core.rig.network import POSE, feature_columns
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rig.rods import RigMaterial
from neuralocks_core.training.rig.energy import RigEnergy
from neuralocks_core.training.rig.poses import Moments, PosePool

COLLIDING = 96
"""Hair vertices that collide in one step, drawn again in each: finding the nearest body is half of a step's time."""
EVERY, RENEWED = 16, 8
"""Every EVERY steps, RENEWED poses are replaced: with a fixed pool, hair avoids the bodies that it knows, and goes twice as
deep into others."""
HARD = 256
"""This many situations in which hair was deepest are remembered. At random they are too rare to be learned: of 1,000 held-out
poses, hair is then deeper than 5 mm in ten to twenty; with them, in at most six."""

GENTLE, GROWING = 1e-3, 0.6
"""Contact begins with this share of its weight, which grows evenly in its logarithm over this share of the budget. With full
weight from the start, the first steps throw hair far off the body, and whether it comes down in front of a shoulder or behind
it is luck: one seed in four never comes near the others' energy."""


def contact_weight(done: float) -> float:
    """Share of the contact weight when a share `done` of the budget is used."""
    return GENTLE ** max(0.0, 1.0 - done / GROWING)


class HairOnBodies:
    """A pool of bodies and the energy of hair on them.

    Args:
        rig: chains, hair vertices and body.
        material: constants of the energy.
        count: number of bodies to draw from.
        rng: decides which bodies.
        spec: the network's inputs.
        moments: moments of motion to draw the bodies from; held poses of random necks if left out.
    """

    def __init__(
        self,
        rig: HairRig,
        material: RigMaterial,
        count: int,
        rng: np.random.Generator,
        spec,
        moments: Moments | None = None,
    ):
        self.pool = PosePool(rig, count, rng, moments)
        self.energy = RigEnergy(rig, material)
        self._rng, self._spec, self._taken = rng, spec, 0
        # Body, features, and collision energy at its last use.
        self._hard = (np.zeros(0, int), np.zeros((0, len(feature_columns(spec))), np.float32), np.zeros(0, np.float32))

    def parts(self, net: torch.nn.Module, batch: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Elastic energy (batch - batch // 2,) of a network's outputs in random situations, and collision energy (batch,) in
        these and, for up to half, in those where hair was deepest before: they teach it to avoid bodies, but are no fair sample.

        Args:
            net: features (B, F) -> turns (B, N, 4).
            batch: number of situations.
        """
        self._taken += 1
        if self._taken % EVERY == 0:
            kept = ~np.isin(self._hard[0], self.pool.renew(RENEWED))
            self._hard = tuple(part[kept] for part in self._hard)
        known = len(self._hard[0])
        chosen = self._rng.permutation(known)[: batch // 2]
        fresh = self._rng.integers(0, self.pool.count, batch - len(chosen))
        bodies = np.concatenate([self._hard[0][chosen], fresh])
        features = np.concatenate([self._hard[1][chosen], self.pool.situations(self._spec, fresh)])
        turns = net(torch.as_tensor(features))
        some = self.energy.draw(self._rng, COLLIDING)
        parts = self.energy.parts(self.pool, bodies, turns, features[:, POSE - 3 : POSE], some)
        left = np.delete(np.arange(known), chosen)
        met = (bodies, features, parts[1].detach().numpy())
        every = tuple(np.concatenate([old[left], new]) for old, new in zip(self._hard, met))
        hardest = np.argsort(-every[2], kind="stable")[:HARD]
        self._hard = tuple(part[hardest] for part in every)
        return parts[0][batch // 2 :], parts[1]
