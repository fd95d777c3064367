# SPDX-License-Identifier: Apache-2.0
"""Energies of hair in a pose, per unit line density, in numpy for the report card (docs/architecture.md, Physics).

Self-supervised training minimises those of `physics/energies.py`; the solver has its own in `reference/kernels/energy.py`.
"""

import numpy as np

from neuralocks_core.materials import STRETCH, Material
from neuralocks_core.motion import G
from neuralocks_core.rotation import unit
from neuralocks_core.strands.bends import bends

BLOCK = 64
"""Frames processed at a time: intermediate results of each take several times its own memory."""


def energies(
    points: np.ndarray, rest: np.ndarray, down: np.ndarray, material: Material | None = None
) -> dict[str, np.ndarray]:
    """Mean energy per unit mass of each frame (T,) [m^2/s^2 = J/kg], relative to the groom carried rigidly.

    Args:
        points: (T, S, K, 3) [m] canonical.
        rest: (S, K, 3) [m] canonical.
        down: unit vectors of gravity in canonical axes, (T, 3).
        material: constants; the default material if left out.

    Returns:
        sums over all vertices, divided by the mass of all. `gravity`: -g weight m (x - x_rest) . down (paper section
        3.4.3, equation 6), m half the adjacent rest lengths; `bend`: B/2 l |Omega - Omega_rest|^2 (section 3.4.1,
        equation 3) with Omega = 2/l Im(conj(q_i) q_i+1), l half of both rest edges, seen in a frame that follows the
        strand without twist.
    """
    material = material or Material()
    rest = np.asarray(rest, float)
    length = np.linalg.norm(np.diff(rest, axis=1), axis=2)
    length = np.maximum(length, 1e-9)
    mass = np.zeros(rest.shape[:2])
    mass[:, :-1] += length / 2
    mass[:, 1:] += length / 2
    total = mass.sum()
    between = (length[:, 1:] + length[:, :-1]) / 2
    at_rest = curvature(rest[None])
    found = {"gravity": np.zeros(len(points)), "bend": np.zeros(len(points))}
    for first in range(0, len(points), BLOCK):
        some = slice(first, first + BLOCK)
        now = np.asarray(points[some], float)
        drop = np.einsum("tskc,tc->tsk", now - rest, down[some])
        found["gravity"][some] = -G * material.weight * (mass * drop).sum(axis=(1, 2)) / total
        change = curvature(now) - at_rest
        found["bend"][some] = 0.5 * material.bend * (np.square(change).sum(axis=-1) / between).sum(axis=(1, 2)) / total
    return found


def stretch_energy(lengths: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Mean of K/2 strain^2 per unit mass of each frame (T,) [m^2/s^2 = J/kg].

    Args:
        lengths: (T, E) [m] of a groom's own edges; with chords of finer hair, bending would count as stretch.
        rest: (E,) [m] at rest; zero-length edges count nothing.
    """
    strain = np.asarray(lengths, float) / np.maximum(rest, 1e-9) - 1
    return 0.5 * STRETCH * (np.square(strain) * rest).sum(axis=1) / max(rest.sum(), 1e-9)


def curvature(points: np.ndarray) -> np.ndarray:
    """2 Im(q) = 2 sin(angle / 2) n at each inner vertex of strands (..., K, 3) [m]: (..., K - 2, 3), see `bends`."""
    edges = np.diff(np.asarray(points, float), axis=-2)
    return 2 * bends(unit(edges))
