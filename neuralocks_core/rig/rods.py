# SPDX-License-Identifier: Apache-2.0
"""Hair joint chains as rods: their weight, the stiffness of their joints, the force that holds them at rest."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.motion import GRAVITY
from neuralocks_core.rig.chains import HairChains


@dataclass(frozen=True)
class RigMaterial:
    """Constants of rigged mesh hair.

    Attributes:
        bend: bend and twist stiffness over line density [m^4/s^2].
        weight: factor on gravity.
        collision: stiffness of the body [1/(m s^2)], cubic, linear beyond 2 cm.
        margin: distance kept from the body [m]; never more than the vertex has at rest.
        damping: of motion in the head's frame [1/s] (dynamic variant).
        rest_support: hold the bind pose against its own weight: the artist modelled it that way.
    """

    bend: float = 1e-2
    weight: float = 1.0
    collision: float = 3e7
    margin: float = 0.008
    damping: float = 6.0
    rest_support: bool = True


class RodTree:
    """Masses and stiffnesses of a forest of bones, numpy float64.

    Attributes:
        mass: of each bone's far end, share of the total, (M,).
        stiffness: of each joint [m^2/s^2], energy = stiffness * 2 |Im q|^2, (N,).
        support: force that holds the bind pose, fixed in the head's axes, at each bone's far end [m/s^2], (M, 3).
    """

    def __init__(self, chains: HairChains, material: RigMaterial):
        lengths, bones = chains.lengths, len(chains.bones)
        total = lengths.sum()
        below = [np.flatnonzero(chains.bone_joint == end) for end in chains.bone_end]  # none at a free end, which is -1
        self.mass = np.array([(lengths[b] + lengths[below[b]].sum()) / 2 for b in range(bones)]) / total
        to_joint = {int(end): b for b, end in enumerate(chains.bone_end) if end >= 0}
        own = np.array([lengths[chains.bone_joint == j].mean() for j in range(len(chains))])
        before = np.array([lengths[to_joint[j]] if j in to_joint else 0.0 for j in range(len(chains))])
        self.stiffness = material.bend / ((own + before) / 2) / total
        gravity = GRAVITY * material.weight
        self.support = np.zeros((bones, 3))
        pull = np.zeros((bones, 3))
        # Tip to root: support takes the part of the weight that tension along the bone cannot carry.
        for bone in np.argsort(-chains.bone_joint, kind="stable"):
            load = self.mass[bone] * gravity + sum((pull[b] for b in below[bone]), np.zeros(3))
            along = chains.bones[bone] / lengths[bone]
            pull[bone] = max(0.0, load @ along) * along
            self.support[bone] = pull[bone] - load
        if not material.rest_support:
            self.support[:] = 0
