# SPDX-License-Identifier: Apache-2.0
"""Held poses to learn from: random necks and bodies, renewed all the while, and what the hair's answer costs there."""

from dataclasses import replace

import numpy as np
import torch

from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.training.rig_energy import RigEnergy, RigMaterial
from neuralocks_core.training.rig_poses import PosePool

COLLIDING = 96
"""Hair vertices that collide in one step, drawn anew: finding the nearest body is half of a step's time."""
ROOM = 0.006
"""Kept from the body over the material's margin while learning [m]: the network cannot see the body's shape, nor hit the
mark to the millimetre, and so goes less deep into the body."""
EVERY, RENEWED = 16, 8
"""Every so many steps so many poses are replaced: with a fixed pool the hair kept clear of the bodies that it knew, and
went twice as deep into others."""


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
        self.energy = RigEnergy(rig, replace(material, margin=material.margin + ROOM))
        self._rng, self._spec, self._taken = rng, spec, 0

    def parts(self, net: torch.nn.Module, batch: int) -> tuple[torch.Tensor, torch.Tensor]:
        """Elastic and collision energy (batch,) of a network's answers in poses drawn anew."""
        self._taken += 1
        if self._taken % EVERY == 0:
            self.pool.renew(RENEWED)
        poses = self._rng.integers(0, self.pool.count, batch)
        gravity = self.pool.gravity(poses)
        turns = net(torch.as_tensor(self.pool.features(self._spec, poses, gravity)))
        return self.energy.parts(self.pool, poses, turns, gravity, self.energy.draw(self._rng, COLLIDING))
