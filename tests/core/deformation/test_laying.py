# SPDX-License-Identifier: Apache-2.0
"""What is swept slowly through a body goes on slowly over its surface, and never into it."""

import numpy as np
import pytest
import trimesh

from neuralocks_core.body.collider import Collider
from neuralocks_core.body.near_body import NearBody
from neuralocks_core.deformation.laying import MARGIN, clearance, resolved
from neuralocks_core.skinned_body import Body

STEPS = 161


def shapes():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    waist = ball.vertices * (1 - 0.15 * np.exp(-np.square(ball.vertices[:, 1:2] / 0.03)))
    capsule = trimesh.creation.capsule(height=0.1, radius=0.06, count=(48, 48))
    return {"ball": ball, "waist": trimesh.Trimesh(waist, ball.faces), "capsule": trimesh.Trimesh(
        capsule.vertices - capsule.vertices.mean(axis=0), capsule.faces)}  # fmt: skip


def swept(curl: float) -> np.ndarray:
    """Strands (STEPS, 12, 24, 3) [m] that hang beside a body and turn about their roots until they are deep in it."""
    sunk = np.linspace(0, 0.7, STEPS)[:, None, None]
    along, side = 0.011 * np.arange(24), np.linspace(0.015, 0.05, 12)[:, None]
    phase = curl * np.arange(24) / 24 * 2 * np.pi
    ring = 0.006 * (np.arange(24) > 1)
    x = -0.13 + along * np.sin(sunk) + ring * np.cos(phase) * (curl > 0) + 0 * side
    y = 0.09 - along * np.cos(sunk) + 0 * side
    z = side + ring * np.sin(phase) * (curl > 0) + 0 * sunk
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1).astype(np.float32)


@pytest.mark.parametrize("still", [True, False], ids=["still", "moving"])
@pytest.mark.parametrize("shape", ["ball", "waist", "capsule"])
@pytest.mark.parametrize("curl", [0, 3])
def test_what_is_swept_through_a_body_goes_on_over_it(shape, still, curl):
    mesh = shapes()[shape]
    count = len(mesh.vertices)
    near = NearBody(
        Body(mesh.vertices, mesh.faces, np.zeros((count, 1), int), np.ones((count, 1))),
        np.eye(4), np.full(count, still), np.full(3, -0.4), np.full(3, 0.4))  # fmt: skip
    body = near.posed(np.eye(4)[None], None, np.full(3, -0.4), np.full(3, 0.4))
    wanted = swept(curl)
    free = clearance(np.full((STEPS * 12, 24), 0.02))
    found = resolved(wanted.reshape(-1, 24, 3), body, free).reshape(wanted.shape)
    inside = Collider(mesh.vertices, mesh.faces)
    assert inside.distance(wanted[-1], limit=0.02)[0].min() < -0.015
    assert inside.distance(found[::8, :, 2:], limit=0.02)[0].min() > -MARGIN
    step, most = (np.linalg.norm(np.diff(each, axis=0), axis=3).max() for each in (found, wanted))
    assert step < 6 * most
    length = [np.linalg.norm(np.diff(each, axis=2), axis=3) for each in (found, wanted)]
    np.testing.assert_allclose(*length, atol=2e-7)
