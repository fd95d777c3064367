# SPDX-License-Identifier: Apache-2.0
"""Grooms that are hard on what resamples and carries them, about a head at ORIGIN, its middle at CENTRE from there."""

import numpy as np

from neuralocks_core.groom import Groom

ORIGIN = np.array([0.0, 1.5, 0.02])
CENTRE = np.array([0.0, 0.1, 0.0])


def ragged_groom(seed=0, strands=300):
    """Random walks out of a head, of 0 to 60 vertices, with repeated points and some strands of no length."""
    random = np.random.default_rng(seed)
    counts = random.integers(0, 61, strands)
    root = random.normal(size=(strands, 3))
    root *= 0.09 / np.linalg.norm(root, axis=1, keepdims=True)
    pieces = []
    for s, n in enumerate(counts):
        step = random.normal(size=(n, 3)) * 0.01 + root[s] * 0.1
        step[random.random(n) < 0.1] = 0.0
        if s % 17 == 0:
            step[:] = 0.0
        pieces.append(ORIGIN + CENTRE + root[s] + np.cumsum(step, axis=0))
    return Groom("/hair", np.concatenate(pieces), counts)


def coil_groom(strands=20, vertices=400, turns=10.0):
    """Coils of 5 mm radius; ten turns are finer than the network's vertices."""
    t = np.linspace(0.0, 1.0, vertices)
    angle = 2 * np.pi * turns * t
    coil = np.stack([0.005 * np.cos(angle), -0.2 * t, 0.005 * np.sin(angle)], axis=1)
    roots = np.random.default_rng(1).normal(size=(strands, 1, 3)) * 0.05
    return Groom("/coils", (coil + roots).reshape(-1, 3), np.full(strands, vertices))
