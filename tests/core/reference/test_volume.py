# SPDX-License-Identifier: Apache-2.0
"""Strands that keep their distance: the solver's force against the potential's gradient, and what it does."""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the extra 'train' is not installed")
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.reference import simulate


def bundle(count=24, seed=0):
    """Strands (S, 24, 3) that hang side by side from a patch of 3 cm."""
    rng = np.random.default_rng(seed)
    roots = rng.uniform(-0.015, 0.015, (count, 1, 3)) * [1, 0, 1]
    return roots + np.linspace(0, -0.2, 24)[:, None] * [0, 1.0, 0]


def test_the_force_is_the_gradient_of_the_networks_potential():
    torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")
    import warp as wp

    from neuralocks_core.physics.rods import rods
    from neuralocks_core.physics.self_collision import density, self_collision
    from neuralocks_core.reference.volume import Volume
    from neuralocks_core.warp_device import start_warp

    start_warp("cpu")
    rest = bundle()
    closer = rest * [0.6, 1.0, 0.6] + np.random.default_rng(1).normal(size=rest.shape) * 5e-4
    constants = rods(torch.from_numpy(rest), supported=True)
    x = torch.from_numpy(closer).requires_grad_()
    self_collision(x, constants, density(constants.rest, constants.mass), 0.3).sum().backward()

    def put(values, kind):
        return wp.array(np.ascontiguousarray(np.swapaxes(values, 0, 1)), dtype=kind, device="cpu")

    volume = Volume(put(rest, wp.vec3d), put(constants.mass.numpy(), wp.float64), 0.3)
    target, pull = put(closer, wp.vec3d), put(np.full(rest.shape[:2], 1e-3), wp.float64)
    volume.push(put(closer, wp.vec3d), target, pull)
    force = np.swapaxes(pull.numpy()[..., None] * (target.numpy() - np.swapaxes(closer, 0, 1)), 0, 1)
    wanted = -x.grad.numpy()
    assert np.abs(wanted[:, 2:]).max() > 1e-4
    np.testing.assert_allclose(force[:, 2:], wanted[:, 2:], atol=1e-6 * np.abs(wanted).max() + 1e-12)


def test_a_bundle_that_is_swung_stays_wider_with_volume():
    rest = bundle()
    head = np.tile(np.eye(4), (25, 1, 1))
    angle = 0.9 * np.sin(np.linspace(0, 2 * np.pi, 25))
    head[:, :2, :2] = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], 1).reshape(-1, 2, 2)
    ties = np.stack([np.roll(np.arange(len(rest)), i) for i in (5, 9)], axis=1).astype(int)
    # Held together much more closely than grown: ties to strands whose rest places count as one.
    drawn = rest * [0.2, 1.0, 0.2] + rest[:, :1] * [0.8, 0.0, 0.8]

    def width(volume):
        points = simulate(drawn, head, neighbours=ties, volume=volume).points
        assert np.isfinite(points).all()
        edges = np.linalg.norm(np.diff(points, axis=2), axis=-1)
        np.testing.assert_allclose(edges, np.broadcast_to(edges[:1], edges.shape), rtol=1e-4)
        return np.linalg.norm(points - points.mean(axis=1, keepdims=True), axis=-1)[5:, :, 8:].mean()

    assert width(3.0) > width(0.0)


def test_volume_changes_nothing_at_rest_and_refuses_nonsense():
    rest, head = bundle(8), np.tile(np.eye(4), (4, 1, 1))
    still = simulate(rest, head, volume=0.3).points
    assert np.abs(still - rest).max() < 1e-5
    with pytest.raises(NeuralocksError, match="volume"):
        simulate(rest, head, volume=float("nan"))


def test_hair_with_volume_begins_at_rest():
    """On a head that hangs upside down, and is still, a bundle has fallen before the first frame."""
    head, rest = np.tile(np.eye(4), (4, 1, 1)), bundle()
    head[:, 1:3, 1:3] = [[-0.5, -np.sqrt(0.75)], [np.sqrt(0.75), -0.5]]
    points = simulate(rest, head, volume=0.3).points
    assert np.linalg.norm(points[0] - rest, axis=-1).max() > 0.2
    assert np.linalg.norm(points - points[:1], axis=-1).max() < 1e-3
