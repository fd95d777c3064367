# SPDX-License-Identifier: Apache-2.0
"""Heads of hair that move, for tests of the simulators."""

import numpy as np
from scipy.spatial.transform import Rotation

from neuralocks_core.models.network_sizes import K


def sphere(radius=0.098):
    """A closed ball (V, 3), (F, 3), by hand: 24 x 12 quads and two fans."""
    rows, columns = 12, 24
    up = np.linspace(0, np.pi, rows + 1)[1:-1]
    around = np.arange(columns) * 2 * np.pi / columns
    ring = np.stack(
        [
            np.outer(np.sin(up), np.cos(around)),
            np.outer(np.cos(up), np.ones(columns)),
            np.outer(np.sin(up), np.sin(around)),
        ],
        -1,
    )
    points = radius * np.concatenate([ring.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])
    top, bottom = len(points) - 2, len(points) - 1
    faces = []
    for c in range(columns):
        d = (c + 1) % columns
        faces += [[top, d, c], [bottom, (rows - 2) * columns + c, (rows - 2) * columns + d]]
        for r in range(rows - 2):
            a, b, e, f = r * columns + c, r * columns + d, (r + 1) * columns + c, (r + 1) * columns + d
            faces += [[a, b, e], [b, f, e]]
    return points, np.array(faces)


def groom(strands=12, curl=0.4, seed=0):
    """Strands that leave a head of 10 cm, fall, and curl."""
    rng = np.random.default_rng(seed)
    out = rng.normal(size=(strands, 3))
    out[:, 1] = 0.4 + np.abs(out[:, 1])
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    s = np.linspace(0, 1, K - 1)[None, :, None]
    bow = np.clip(6 * s, 0, 1) * np.pi / 2
    side = np.cross(out, [0.0, 1.0, 0.0])[:, None]
    phase = s * 2 * np.pi / 0.3
    edges = out[:, None] * np.cos(bow) + np.array([0, -1.0, 0]) * np.sin(bow)
    edges = edges + curl * (np.cos(phase) * side + np.sin(phase) * out[:, None])
    edges *= 0.25 / (K - 1) / np.linalg.norm(edges, axis=-1, keepdims=True)
    return 0.101 * out[:, None] + np.concatenate([np.zeros((strands, 1, 3)), np.cumsum(edges, 1)], 1)


def heads(turns, origin):
    head = np.tile(np.eye(4), (len(turns), 1, 1))
    head[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    head[:, :3, 3] = origin
    return head


def shaken(frames=20, size=0.6):
    t = np.arange(frames) / 30
    turns = size * np.sin(2 * np.pi * 1.5 * t)[:, None] * np.array([0.2, 1.0, 0.3])
    return heads(turns, 0.1 * np.sin(2 * np.pi * t)[:, None] * np.array([1.0, 0.5, 0]))


def carried(head, points):
    return (np.einsum("tij,vj->tvi", head[:, :3, :3], points) + head[:, None, :3, 3]).astype(np.float32)


def edge_lengths(points):
    return np.linalg.norm(np.diff(points, axis=-2), axis=-1)
