# SPDX-License-Identifier: Apache-2.0
"""Slow and trusted: the rod solver that results are compared with, and what games use. Needs warp (extra `compare`)."""

from neuralocks_core.reference.floor import Floor, stateless_floor
from neuralocks_core.reference.solver import SimulatedHair, simulate
from neuralocks_core.reference.xpbd import simulate_xpbd

__all__ = ["Floor", "SimulatedHair", "simulate", "simulate_xpbd", "stateless_floor"]
