# SPDX-License-Identifier: Apache-2.0
"""Curvature and energies of shapes for which they are known."""

import numpy as np
import pytest

from neuralocks_core.evaluation.pose_energies import curvature, energies, stretch_energy
from neuralocks_core.materials import Material


def arc(radius, plane=0.0, count=24, length=0.24):
    """A strand bent to a circle, first along +Y; its plane turned about Y."""
    angle = np.linspace(0, length / radius, count)
    flat = np.stack([radius * (1 - np.cos(angle)), radius * np.sin(angle), 0 * angle], axis=1)
    c, s = np.cos(plane), np.sin(plane)
    return flat @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])


def test_curvature_of_a_circle_is_one_over_its_radius():
    points = arc(0.05)
    step = np.linalg.norm(np.diff(points, axis=0), axis=1).mean()
    np.testing.assert_allclose(np.linalg.norm(curvature(points), axis=1) / step, 20, rtol=2e-3)
    np.testing.assert_allclose(curvature(points)[1:], np.broadcast_to(curvature(points)[1], (21, 3)), atol=1e-9)


def test_energies_of_known_shapes():
    rest = np.zeros((1, 24, 3))
    rest[0, :, 1] = np.linspace(0, 0.24, 24)
    down = np.array([[0, -1.0, 0]])
    zero = energies(rest[None], rest, down)
    assert all(abs(value[0]) < 1e-12 for value in zero.values())
    longer = energies(rest[None] * 1.1, rest, down)
    edges = np.array([0.01, 0.02, 0.0])
    np.testing.assert_allclose(
        stretch_energy(np.stack([edges, 1.1 * edges]), edges), [0, 0.5 * 1000 * 0.01], atol=1e-12
    )
    assert longer["gravity"][0] == pytest.approx(9.81 * 0.012)
    heavy = energies(rest[None] * 1.1, rest, down, Material(weight=2.0))
    assert heavy["gravity"][0] == pytest.approx(2 * longer["gravity"][0])
    bent = energies(arc(0.1)[None, None], rest, down, Material(bend=2e-3))
    assert bent["bend"][0] == pytest.approx(0.5 * 2e-3 * 10**2, rel=0.06)
