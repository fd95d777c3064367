# SPDX-License-Identifier: Apache-2.0
"""Strands keep their distance as a crowd: smoothed density that may not rise above the groom's own.

The energy is that of `physics.self_collision` (paper section 3.4.2, equation 5, on relative density). It ties every
strand to all around it, so the solver takes it as a force that is looked up anew between its Newton solves, with a
spring to where the vertex is now that keeps a step from overshooting.
"""

import math

import warp as wp

from neuralocks_core.materials import SMOOTHING
from neuralocks_core.reference.kernels.banded import array_real, array_vec

STRIDE = wp.constant(wp.float64(0.1 * SMOOTHING))
"""[m] Most that this force alone moves a vertex between two looks at it."""
H = wp.constant(wp.float64(SMOOTHING))
PEAK = wp.constant(wp.float64(1.0 / (4.0 * math.pi * SMOOTHING**3)))
REACH = wp.constant(wp.float32(2.0 * SMOOTHING))
LEAST = wp.constant(wp.float64(1e-12))


class Volume:
    """Densities of all vertices and the force that follows.

    Args:
        rest: (K, S) vec3d rest points on the device.
        mass: (K, S) float64 masses per unit line density [m].
        stiffness: [m^2/s^2].
    """

    def __init__(self, rest: array_vec, mass: array_real, stiffness: float):
        self.mass, self.stiffness, self.device = mass, float(stiffness), rest.device
        shape = rest.shape
        self.grid = wp.HashGrid(128, 128, 128, device=self.device)
        self.points = wp.zeros(shape, dtype=wp.vec3, device=self.device)
        self.rest_density = wp.zeros(shape, dtype=wp.float64, device=self.device)
        self.pressure = wp.zeros(shape, dtype=wp.float64, device=self.device)
        self._look(rest)
        self._run(densities, rest, self.rest_density)

    def push(self, x: array_vec, target: array_vec, pull: array_real) -> None:
        """Add the force at (K, S) points `x` to the springs pull/2 |x - target|^2 that the solver follows."""
        self._look(x)
        self._run(densities, x, self.pressure)
        self._run(pressures, self.rest_density, self.pressure)
        self._run(push, x, self.pressure, self.stiffness, target, pull)

    def _look(self, x: array_vec) -> None:
        wp.launch(rounded, dim=x.shape, inputs=[x, self.points], device=self.device)
        self.grid.build(self.points.flatten(), float(REACH))

    def _run(self, kernel, x: array_vec, *rest) -> None:
        inputs = [self.grid.id, self.points.flatten(), self.mass, x, *rest]
        if kernel is pressures:
            inputs = [x, *rest]
        wp.launch(kernel, dim=self.mass.shape, inputs=inputs, device=self.device)


@wp.func
def slope(distance: wp.float64):
    """dW/dr of the cubic spline whose value `weight` is [1/m^4]."""
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
    """Single precision is what the grid of neighbours takes."""
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
    """3 max(rho / rho_rest - 1, 0)^2 / rho_rest, in place of the density."""
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
    """The energy's negative gradient, as a shift of the spring `pull` to `target` that stands for all other forces.

    pressure: of `pressures`; stiffness [m^2/s^2]; grid and points as in `densities`.
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
