# SPDX-License-Identifier: Apache-2.0
"""The rod solver against answers that are known without it.

A strand of K vertices is clamped along its first edge. Bending at vertex 1 stands for half an edge to each side, so the
beam that it models begins in the middle of that edge; without stiffness the chain hangs from vertex 1.
"""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the reference needs warp")
from scipy.integrate import solve_bvp
from scipy.special import j0, jn_zeros

from neuralocks_core.reference import simulate
from neuralocks_core.reference.rest import rest_rods

K, LENGTH, G = 24, 0.3, 9.81
EDGE = LENGTH / (K - 1)


def straight(direction):
    return np.linspace(0, LENGTH, K)[None, :, None] * np.asarray(direction, float)


def still(frames=1):
    return np.tile(np.eye(4), (frames, 1, 1))


def settled(rest, **options):
    material = {"bend": options.pop("bend"), "damping": 0.0}
    result = simulate(rest, still(), material=material, rest_support=False, iterations=100, tolerance=1e-8, **options)
    assert result.residual[0] < 1e-4
    return result.points[0, 0].astype(float)


def test_circle_has_the_curvature_of_its_radius():
    """Omega = 2/l sin(theta/2) = 1/R at every vertex between two edges, and along one axis."""
    radius = 0.07
    angle = np.linspace(0, 4, K)
    points = radius * np.stack([np.sin(angle), np.cos(angle), 0 * angle], -1)[None]
    rods = rest_rods(points)
    omega = 2 * rods.curl[0, 1:-1] / rods.mass[0, 1:-1, None]
    np.testing.assert_allclose(omega, np.broadcast_to([0, 0, -1 / radius], omega.shape), atol=1e-9)


def test_small_droop_of_a_cantilever():
    """Tip of a uniformly loaded cantilever: w L^4 / (8 EI)."""
    bend, load = 1e-2, 0.02
    tip = settled(straight([0, 0, 1]), bend=bend, gravity=load)[-1]
    beam = LENGTH - EDGE / 2
    assert -tip[1] == pytest.approx(load * beam**4 / (8 * bend), rel=0.01)


def test_large_droop_of_a_cantilever_is_the_elastica():
    """EI theta'' = -w (L - s) cos(theta), theta(0) = 0, theta'(L) = 0."""
    bend = 2e-3
    beam = LENGTH - EDGE / 2

    def slope(s, y):
        return [y[1], -G / bend * (beam - s) * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

    def ends(a, b):
        return [a[0], b[1], a[2], a[3]]

    s = np.linspace(0, beam, 400)
    guess = np.stack([1 - np.exp(-10 * s), np.exp(-10 * s), s, s])
    answer = solve_bvp(slope, ends, s, guess, tol=1e-8, max_nodes=20000)
    assert answer.success
    tip = settled(straight([0, 0, 1]), bend=bend)[-1]
    # the BVP walks to the half-edge grid; the strand's own clamp is half an edge long
    np.testing.assert_allclose([tip[2] - EDGE / 2, -tip[1]], [answer.y[2, -1], answer.y[3, -1]], atol=0.005 * LENGTH)


def test_a_chain_without_stiffness_hangs_from_its_clamp():
    points = settled(straight([0, 0, 1]), bend=0.0)
    below = points[1:] - points[1]
    expected = np.zeros_like(below)
    expected[:, 1] = -EDGE * np.arange(K - 1)
    np.testing.assert_allclose(below, expected, atol=1e-3)


def first_mode(amplitude):
    """The hanging chain's slowest mode, J0(2 omega sqrt(s/g)) with s up from the tip, and its period.

    The period is 2 pi sqrt(L/g) / 1.2024.
    """
    chain = LENGTH - EDGE
    rest = straight([0, -1, 0])
    up = chain + rest[0, :, 1] + EDGE
    sideways = amplitude * j0(jn_zeros(0, 1)[0] * np.sqrt(np.clip(up / chain, 0, 1)))
    start = rest.copy()
    start[0, 1:, 0] = sideways[1:] - sideways[1]
    return rest, start, 2 * np.pi * np.sqrt(chain / G) / 1.2024


def swing(damping, substeps):
    rest, start, period = first_mode(0.01)
    material = {"bend": 0.0, "damping": damping}
    result = simulate(rest, still(91), material=material, start=start, substeps=substeps, iterations=30, tolerance=1e-6)
    tip = result.points[:, 0, -1, 0].astype(float)
    cross = np.flatnonzero(np.diff(np.sign(tip)))
    at = cross + tip[cross] / (tip[cross] - tip[cross + 1])
    return tip, 2 * np.mean(np.diff(at)) / 30, period


def envelope_rate(tip, period):
    """Decay rate [1/s] from the energy-like envelope tip^2 + (tip'/omega)^2."""
    omega = 2 * np.pi / period
    size = np.hypot(tip, np.gradient(tip, 1 / 30) / omega)[3:-3]
    return -np.polyfit(np.arange(len(size)) / 30, np.log(size), 1)[0]


def test_pendulum_period():
    _, period, expected = swing(0.0, 16)
    assert period == pytest.approx(expected, rel=0.01)


def test_pendulum_decay():
    """Damping c per mass slows every mode by exp(-c t / 2); what implicit Euler adds shrinks with the step."""
    bare, _, period = swing(0.0, 32)
    damped, _, _ = swing(2.0, 32)
    numerical = envelope_rate(bare, period)
    assert numerical < 0.06
    assert envelope_rate(damped, period) - numerical == pytest.approx(1.0, rel=0.05)


def test_error_halves_with_the_step():
    """Implicit Euler is of first order: distances between successive halvings shrink by two."""
    tips = [swing(1.0, substeps)[0] for substeps in (4, 8, 16)]
    coarse, fine = (np.abs(a - b).max() for a, b in zip(tips, tips[1:], strict=False))
    assert coarse / fine == pytest.approx(2.0, abs=0.4)
