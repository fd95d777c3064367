# SPDX-License-Identifier: Apache-2.0
"""Strands keep their volume: a smoothed density that may not rise above the groom's own.

The energy is that of `physics.self_collision` (paper section 3.4.2, equation 5, on relative density). It couples every
strand to all strands around it. So the solver treats it as a force that is updated between its Newton solves, with a
spring to the vertex's current position that keeps a step from overshooting.
"""

import warp as wp

from neuralocks_core.reference.kernels import volume as kernels
from neuralocks_core.reference.kernels.banded import array_real, array_vec


class Volume:
    """Densities of all vertices and the resulting force.

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
        self._run(kernels.densities, rest, self.rest_density)

    def push(self, x: array_vec, target: array_vec, pull: array_real) -> None:
        """Add the force at (K, S) points `x` to the springs pull/2 |x - target|^2 of the solver."""
        self._look(x)
        self._run(kernels.densities, x, self.pressure)
        wp.launch(kernels.pressures, dim=self.mass.shape, inputs=[self.rest_density, self.pressure], device=self.device)
        self._run(kernels.push, x, self.pressure, self.stiffness, target, pull)

    def _look(self, x: array_vec) -> None:
        wp.launch(kernels.rounded, dim=x.shape, inputs=[x, self.points], device=self.device)
        self.grid.build(self.points.flatten(), float(kernels.REACH))

    def _run(self, kernel, x: array_vec, *rest) -> None:
        inputs = [self.grid.id, self.points.flatten(), self.mass, x, *rest]
        wp.launch(kernel, dim=self.mass.shape, inputs=inputs, device=self.device)
