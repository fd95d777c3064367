# SPDX-License-Identifier: Apache-2.0
"""Held poses to learn from: random necks and bodies, renewed all the while, and what the hair's answer costs there."""

import numpy as np
import torch

from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.training.rig_energy import RigEnergy, RigMaterial
from neuralocks_core.training.rig_poses import PosePool

COLLIDING = 96
"""Hair vertices that collide in one step, drawn anew: finding the nearest body is half of a step's time."""
EVERY, RENEWED = 16, 8
"""Every so many steps so many poses are replaced: with a fixed pool the hair kept clear of the bodies that it knew, and
went twice as deep into others."""
HARD = 256
"""So many situations in which hair lay deepest are remembered. Among random ones alone they are met too seldom to be
learned: after 5,000 steps hair was deeper than 5 mm in fifteen of 3,000 held-out poses, and is in one to three."""


class HeldPoses:
    """A pool of poses and the energy of hair in them.

    Args:
        rig: chains, hair vertices and body.
        material: constants of the energy.
        count: poses to draw from.
        rng: decides the poses.
        spec: what the network reads.
    """

    def __init__(self, rig: HairRig, material: RigMaterial, count: int, rng: np.random.Generator, spec):
        self.pool = PosePool(rig, count, rng)
        self.energy = RigEnergy(rig, material)
        self._rng, self._spec, self._taken = rng, spec, 0
        # Pose, direction of gravity, and collision energy when last met.
        self._hard = (np.zeros(0, int), np.zeros((0, 3)), np.zeros(0, np.float32))

    def parts(self, net: torch.nn.Module, batch: int, again: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
        """Elastic and collision energy (batch,) of a network's answers.

        Args:
            net: features (B, F) -> turns (B, N, 4).
            batch: how many situations.
            again: how many of them, at most, are those in which hair lay deepest before; the others are new.
        """
        self._taken += 1
        if self._taken % EVERY == 0:
            kept = ~np.isin(self._hard[0], self.pool.renew(RENEWED))
            self._hard = tuple(part[kept] for part in self._hard)
        known = len(self._hard[0])
        chosen = self._rng.permutation(known)[:again]
        fresh = self._rng.integers(0, self.pool.count, batch - len(chosen))
        poses = np.concatenate([self._hard[0][chosen], fresh])
        gravity = np.concatenate([self._hard[1][chosen], self.pool.gravity(fresh)])
        turns = net(torch.as_tensor(self.pool.features(self._spec, poses, gravity)))
        parts = self.energy.parts(self.pool, poses, turns, gravity, self.energy.draw(self._rng, COLLIDING))
        if again:
            left = np.delete(np.arange(known), chosen)
            met = (poses, gravity, parts[1].detach().numpy())
            every = tuple(np.concatenate([old[left], new]) for old, new in zip(self._hard, met))
            hardest = np.argsort(-every[2], kind="stable")[:HARD]
            self._hard = tuple(part[hardest] for part in every)
        return parts
