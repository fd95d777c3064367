# SPDX-License-Identifier: Apache-2.0
"""A ball with hair that is drawn quickly."""

import numpy as np
import trimesh

from neuralocks_core.preview.film import Detail, Scene

CENTRE = np.array([0.0, 1.5, 0.0])
SMALL = Detail(2000, 16, 1, 1)


def scene(frames=4, strands=300):
    """A ball with hair on its upper half that turns about Y."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    body = np.array(ball.vertices) + CENTRE
    rng = np.random.default_rng(0)
    out = rng.normal(size=(strands, 3))
    out[:, 1] = np.abs(out[:, 1])
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    rest = CENTRE + out[:, None] * np.linspace(0.1, 0.2, 10)[None, :, None]
    rest[:, :, 1] -= np.linspace(0, 0.3, 10) ** 2
    rest = rest.reshape(-1, 3)
    head = np.tile(np.eye(4), (frames, 1, 1))
    for i, angle in enumerate(np.linspace(0, 1, frames)):
        turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
        head[i, :3, :3] = turn
        head[i, :3, 3] = CENTRE - turn @ CENTRE

    def posed(points):
        return lambda i: points @ head[i, :3, :3].T + head[i, :3, 3]

    return Scene(
        np.arange(frames) / 24,
        head,
        np.eye(3),
        CENTRE,
        np.full(strands, 10),
        rest,
        posed(rest),
        np.array(ball.faces),
        posed(body),
        body,
    )
