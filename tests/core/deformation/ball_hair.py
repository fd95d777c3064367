# SPDX-License-Identifier: Apache-2.0
"""A ball as a head, and strands around it, for tests of what keeps hair out of bodies."""

import numpy as np
import trimesh

HEAD = trimesh.creation.icosphere(subdivisions=4, radius=0.1)


def strands(count=60, turn=1.5, seed=0):
    """Strands that leave a sphere and turn back into it; `turn` is their last direction's angle to the first in pi."""
    rng = np.random.default_rng(seed)
    out = rng.normal(size=(count, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    side = np.cross(out, rng.normal(size=(count, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    angle = np.linspace(0, turn * np.pi, 23)[None, :, None]
    edges = 0.012 * (np.cos(angle) * out[:, None] + np.sin(angle) * side[:, None])
    root = 0.1005 * out
    return np.concatenate([root[:, None], root[:, None] + np.cumsum(edges, axis=1)], axis=1).astype(np.float32)
