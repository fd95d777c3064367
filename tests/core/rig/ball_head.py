# SPDX-License-Identifier: Apache-2.0
"""Mesh hair behind a ball for a head."""

from dataclasses import replace

import numpy as np
import trimesh

from neuralocks_core.rig import find_chains
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.skinned_body import Body
from tests.core.rig.builders import character, tail

RADIUS = 0.12
CENTRE = np.array([0, 0.05, 0.02])
"""Centre of the head's ball, from the head joint."""


def on_a_ball() -> HairRig:
    """A tail of ribbons, 6 cm wide, behind a ball for a head."""
    who = character(tail("hair", 5, at=(0, 1.65, -0.12), step=(0, -0.06, -0.002)))
    ball = trimesh.creation.icosphere(4, RADIUS)
    points = ball.vertices + CENTRE + who.skeleton.bind[who.head, :3, 3]
    joints = np.full((len(points), 1), who.head)
    who = replace(who, body=Body(points, ball.faces, joints, np.ones((len(points), 1))))
    chains = find_chains(who)
    along = chains.origins[:, None] + chains.bones[:, None] * np.linspace(0.1, 0.9, 5)[:, None]
    points = np.concatenate([along + (side, 0, 0) for side in (-0.03, 0.0, 0.03)], axis=1)
    weights = np.repeat(np.eye(len(chains), len(chains) + 1, 1), points.shape[1], axis=0)
    return HairRig(who, chains, points.reshape(-1, 3), weights)
