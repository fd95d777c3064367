# SPDX-License-Identifier: Apache-2.0
"""The rod solver against answers that are known without it.

A strand of K vertices is clamped along its first edge. Bending at vertex 1 stands for half an edge to each side, so the
beam that it models begins in the middle of that edge; without stiffness the chain hangs from vertex 1.
"""

import numpy as np
import pytest

pytest.importorskip("warp", reason="the reference needs warp")
from scipy.integrate import solve_bvp
from scipy.linalg import eigh
from scipy.special import j0, jn_zeros

from neuralocks_core.materials import Material, at_weight_one, constants
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
    """Damping c per mass slows every mode by exp(-c t / 2), and the time step adds next to none, not even one step per frame."""
    for substeps in (1, 4):
        bare, _, period = swing(0.0, substeps)
        damped, _, _ = swing(2.0, substeps)
        numerical = envelope_rate(bare, period)
        assert abs(numerical) < 0.06 / substeps
        assert envelope_rate(damped, period) - numerical == pytest.approx(1.0, rel=0.05)


def test_error_falls_with_the_square_of_the_step():
    """Distances between successive halvings shrink by four on a head that moves as hair can follow: a strand that is let go all
    at once, as those above, goes a part of a step late."""
    rest, seconds = straight([0, 0, 1]), 1.0

    def tip(rate):
        time = np.arange(int(seconds * rate) + 1) / rate
        angle = 0.5 * np.sin(np.pi * time / seconds) ** 4
        head = still(len(time))
        head[:, 0, 0] = head[:, 2, 2] = np.cos(angle)
        head[:, 0, 2], head[:, 2, 0] = np.sin(angle), -np.sin(angle)
        head[:, 0, 3] = 0.1 * np.sin(np.pi * time / seconds) ** 4
        options = {"dt": 1 / rate, "iterations": 60, "tolerance": 1e-7}
        swung = simulate(rest, head, material={"bend": 0.002, "damping": 10.0}, **options)
        return swung.points[:: rate // 30, 0, -1].astype(float)

    tips = [tip(rate) for rate in (60, 120, 240)]
    coarse, fine = (np.abs(a - b).max() for a, b in zip(tips, tips[1:], strict=False))
    assert coarse / fine == pytest.approx(4.0, abs=0.6)


def test_heavy_hair_moves_as_light_hair_does_at_another_speed():
    """Dynamic similarity: networks know hair of weight 1 alone. Stretch and contact are stiff in both, and differ by little."""
    heavy = Material(bend=2e-3, weight=1.8, damping=9.0, clumping=40.0)
    ratios, pace = at_weight_one(heavy.log_ratios())
    assert pace**2 == pytest.approx(1.8)
    rest = np.concatenate([straight([0, 0, 1]), straight([0.1, 0, 0.995]) + [0.004, 0, 0]])
    head, time = still(90), np.arange(90) / 60
    head[:, 0, 3], head[:, 1, 3] = 0.08 * np.sin(9 * time) ** 3, 0.05 * np.sin(7 * time) ** 3
    options = {"neighbours": np.array([[1], [0]]), "iterations": 60, "tolerance": 1e-7}

    def moved(material, dt):
        return simulate(rest, head, material=material, dt=dt, **options).points.astype(float)

    one = Material(*map(float, constants(ratios)))
    slow = moved(one, pace / 60)
    assert np.abs(moved(heavy, 1 / 60) - slow).max() < 2e-4 < 0.02 < np.abs(moved(one, 1 / 60) - slow).max()


def frequency(values, rate):
    """Frequency of a swing about zero [Hz]."""
    cross = np.flatnonzero(np.diff(np.sign(values)))
    at = cross + values[cross] / (values[cross] - values[cross + 1])
    return rate / (2 * np.diff(at).mean())


def test_free_vibration_of_a_cantilever():
    """Euler and Bernoulli: omega = 1.875^2 sqrt(EI / (m L^4)); damping c slows it to sqrt(omega^2 - c^2 / 4)."""
    bend, rate, beam = 0.05, 240, LENGTH - EDGE / 2
    rest = straight([0, 0, 1])
    start, along = rest.copy(), np.maximum(rest[0, :, 2] - EDGE / 2, 0) / beam
    a, b = 1.8751041 * along, 0.7340955
    start[0, 2:, 1] = 0.002 * (np.cosh(a) - np.cos(a) - b * (np.sinh(a) - np.sin(a)))[2:]
    omega = 1.8751041**2 * np.sqrt(bend / beam**4)
    for damping in (0.0, 6.0):
        material = {"bend": bend, "damping": damping}
        options = {"gravity": 1e-6, "dt": 1 / rate, "substeps": 4, "iterations": 30, "tolerance": 1e-8}
        tip = simulate(rest, still(rate), material=material, start=start, **options).points[:, 0, -1, 1]
        expected = np.sqrt(omega**2 - damping**2 / 4) / (2 * np.pi)
        assert frequency(tip.astype(float), rate) == pytest.approx(expected, rel=0.005)


@pytest.mark.parametrize("mode", [0, 1])
def test_both_modes_of_a_double_pendulum(mode):
    """A vertex has half the mass of its edges: two free vertices of masses l and l / 2, on two edges of length l."""
    edge, rate = 0.15, 240
    rest = np.zeros((1, 4, 3))
    rest[0, :, 1] = -edge * np.arange(4)
    mass = edge**3 * np.array([[1.5, 0.5], [0.5, 0.5]])
    squares, shapes = eigh(G * edge**2 * np.diag([1.5, 0.5]), mass)
    start = rest.copy()
    for vertex, angle in zip((2, 3), 0.03 * shapes[:, mode] / np.abs(shapes[:, mode]).max(), strict=True):
        start[0, vertex] = start[0, vertex - 1] + edge * np.array([np.sin(angle), -np.cos(angle), 0])
    options = {"dt": 1 / rate, "substeps": 4, "iterations": 30, "tolerance": 1e-8}
    result = simulate(rest, still(2 * rate), material={"bend": 0.0, "damping": 0.0}, start=start, **options)
    tip = result.points[:, 0, -1, 0].astype(float)
    assert frequency(tip, rate) == pytest.approx(np.sqrt(squares[mode]) / (2 * np.pi), rel=2e-3)


def test_a_strand_whirls_as_a_chain_does():
    """A strand hangs beside the axis of a head that finally turns steadily: each edge points along the sum of gravity and
    centrifugal force on everything behind it. Neither damping nor Coriolis force acts on what rests in the head."""
    spin, mass = 6.0, np.full(K, EDGE)
    mass[-1] /= 2
    rest = straight([0, -1, 0]) + [0.1, 0, 0]
    chain = rest[0].copy()
    for _ in range(300):
        load = mass[:, None] * np.stack([spin**2 * chain[:, 0], np.full(K, -G), np.zeros(K)], axis=1)
        pull = np.cumsum(load[::-1], axis=0)[::-1][2:]
        edges = EDGE * pull / np.linalg.norm(pull, axis=1, keepdims=True)
        chain[2:] = 0.5 * chain[2:] + 0.5 * (chain[1] + np.cumsum(edges, axis=0))
    angle = spin * np.cumsum(np.minimum(np.arange(450) / 60, 1)) / 30
    head = still(450)
    head[:, 0, 0] = head[:, 2, 2] = np.cos(angle)
    head[:, 0, 2], head[:, 2, 0] = np.sin(angle), -np.sin(angle)
    options = {"substeps": 6, "iterations": 40, "tolerance": 1e-6}
    settled = simulate(rest, head, material={"bend": 0.0, "damping": 12.0}, **options).points[-1, 0]
    np.testing.assert_allclose(settled[:, :2], chain[:, :2], atol=1e-3)
    assert chain[-1, 0] - rest[0, -1, 0] > 0.1
    # a method of first order would see the axis a step late, and lag by that
    assert np.abs(settled[:, 2]).max() < 0.05 * spin / 180 * chain[-1, 0]
