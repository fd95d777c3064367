# SPDX-License-Identifier: Apache-2.0
"""Smoothed density of strands, and the force of strands that crowd closer than at rest; see `reference.volume`."""

import math

import warp as wp

from neuralocks_core.materials import SMOOTHING
from neuralocks_core.reference.kernels.banded import array_real, array_vec

STRIDE = wp.constant(wp.float64(0.1 * SMOOTHING))
"""[m] Farthest that this force alone may move a vertex between two updates of it."""
H = wp.constant(wp.float64(SMOOTHING))
PEAK = wp.constant(wp.float64(1.0 / (4.0 * math.pi * SMOOTHING**3)))
REACH = wp.constant(wp.float32(2.0 * SMOOTHING))
LEAST = wp.constant(wp.float64(1e-12))


@wp.func
def slope(distance: wp.float64):
    """dW/dr [1/m^4] of the cubic spline `weight`."""
    s = distance / H
    near = wp.max(wp.float64(1.0) - s, wp.float64(0.0))
    far = wp.max(wp.float64(2.0) - s, wp.float64(0.0))
    return PEAK * (wp.float64(12.0) * near * near - wp.float64(3.0) * far * far) / H


@wp.func
def weight(distance: wp.float64):
    """Monaghan's cubic spline W [1/m^3]."""
    s = distance / H
    near = wp.max(wp.float64(1.0) - s, wp.float64(0.0))
    far = wp.max(wp.float64(2.0) - s, wp.float64(0.0))
    return PEAK * (far * far * far - wp.float64(4.0) * near * near * near)


@wp.kernel(enable_backward=False)
def rounded(x: array_vec, points: wp.array2d(dtype=wp.vec3)):
    """Points in single precision, which the neighbour grid requires."""
    k, s = wp.tid()
    p = x[k, s]
    points[k, s] = wp.vec3(wp.float32(p[0]), wp.float32(p[1]), wp.float32(p[2]))


@wp.kernel(enable_backward=False)
def densities(grid: wp.uint64, points: wp.array(dtype=wp.vec3), mass: array_real, x: array_vec, density: array_real):
    """rho_i = sum_j m_j W(|x_i - x_j|), itself included; `points` are x in float32, in which `grid` was built."""
    k, s = wp.tid()
    p = x[k, s]
    total = wp.float64(0.0)
    for j in wp.hash_grid_query(grid, points[k * x.shape[1] + s], REACH):
        row = j / x.shape[1]
        column = j - row * x.shape[1]
        total += mass[row, column] * weight(wp.length(p - x[row, column]))
    density[k, s] = total


@wp.kernel(enable_backward=False)
def pressures(rest_density: array_real, density: array_real):
    """3 max(rho / rho_rest - 1, 0)^2 / rho_rest, written in place of the density."""
    k, s = wp.tid()
    own = wp.max(rest_density[k, s], LEAST)
    rise = wp.max(density[k, s] / own - wp.float64(1.0), wp.float64(0.0))
    density[k, s] = wp.float64(3.0) * rise * rise / own


@wp.kernel(enable_backward=False)
def push(
    grid: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    mass: array_real,
    x: array_vec,
    pressure: array_real,
    stiffness: wp.float64,
    target: array_vec,
    pull: array_real,
):
    """The energy's negative gradient, as a shift of the spring (`pull`, `target`) that represents all other forces.

    pressure: from `pressures`; stiffness [m^2/s^2]; grid and points as in `densities`.
    """
    k, s = wp.tid()
    if k < 2:
        return
    p = x[k, s]
    mine = pressure[k, s]
    force = wp.vec3d()
    for j in wp.hash_grid_query(grid, points[k * x.shape[1] + s], REACH):
        row = j / x.shape[1]
        column = j - row * x.shape[1]
        away = p - x[row, column]
        distance = wp.length(away)
        if distance > LEAST:
            share = mass[row, column] * (mine + pressure[row, column]) * slope(distance) / distance
            force = force - share * away
    force = stiffness * mass[k, s] * force
    hold = wp.length(force) / STRIDE
    stiff = pull[k, s] + hold
    target[k, s] = (pull[k, s] * target[k, s] + hold * p + force) / stiff
    pull[k, s] = stiff
