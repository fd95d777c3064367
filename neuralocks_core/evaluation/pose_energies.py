# SPDX-License-Identifier: Apache-2.0
"""Energies of hair in a pose, per unit line density, in numpy for the report card (docs/architecture.md, Physics).

What training minimises is `physics/energies.py`.
"""

import numpy as np

from neuralocks_core.materials import Material
from neuralocks_core.motion import G

STRETCH = 1000.0
"""Stiffness against stretch [m^2/s^2]."""


def energies(
    points: np.ndarray, rest: np.ndarray, down: np.ndarray, material: Material | None = None
) -> dict[str, np.ndarray]:
    """Mean energy per unit mass of each frame (T,) [m^2/s^2 = J/kg], relative to the groom carried rigidly.

    Args:
        points: (T, S, K, 3) [m] canonical.
        rest: (S, K, 3) [m] canonical.
        down: unit vectors of gravity in canonical axes, (T, 3).
        material: constants; the default material where left out.

    Returns:
        `gravity`: -g x . down; `bend`: B/2 |Omega - Omega_rest|^2 with
        Omega = 2/l Im(conj(q_i) q_i+1), seen in a frame that follows the strand without twist (paper, bend-twist
        energy with exact transport).
    """
    material = material or Material()
    points, rest = np.asarray(points, float), np.asarray(rest, float)
    length = np.linalg.norm(np.diff(rest, axis=1), axis=2)
    length = np.maximum(length, 1e-9)
    mass = np.zeros(rest.shape[:2])
    mass[:, :-1] += length / 2
    mass[:, 1:] += length / 2
    total = mass.sum()
    drop = np.einsum("tskc,tc->tsk", points - rest, down)
    between = (length[:, 1:] + length[:, :-1]) / 2
    change = curvature(points) - curvature(rest[None])
    bend = 0.5 * material.bend * (np.square(change).sum(axis=-1) / between).sum(axis=(1, 2))
    return {
        "gravity": -G * material.weight * (mass * drop).sum(axis=(1, 2)) / total,
        "bend": bend / total,
    }


def stretch_energy(lengths: np.ndarray, rest: np.ndarray) -> np.ndarray:
    """Mean of K/2 strain^2 per unit mass of each frame (T,) [m^2/s^2 = J/kg].

    Args:
        lengths: (T, E) [m] of a groom's own edges; chords of finer hair would count its bending as stretch.
        rest: (E,) [m] at rest; edges of no length weigh nothing.
    """
    strain = np.asarray(lengths, float) / np.maximum(rest, 1e-9) - 1
    return 0.5 * STRETCH * (np.square(strain) * rest).sum(axis=1) / max(rest.sum(), 1e-9)


def curvature(points: np.ndarray) -> np.ndarray:
    """2 Im(q) = 2 sin(angle / 2) n at each inner vertex (..., K - 2, 3), in axes carried along without twist.

    The axes start as the canonical ones at the root, whose first edge is clamped, and turn from edge to edge by the
    smallest rotation. So a strand that only turns as a whole further down keeps its curvature.
    """
    edges = np.diff(np.asarray(points, float), axis=-2)
    edges /= np.maximum(np.linalg.norm(edges, axis=-1, keepdims=True), 1e-12)
    axes = np.broadcast_to(np.eye(3), (*edges.shape[:-2], 3, 3))
    result = np.empty((*edges.shape[:-2], edges.shape[-2] - 1, 3))
    for i in range(edges.shape[-2] - 1):
        a, b = edges[..., i, :], edges[..., i + 1, :]
        axis = np.cross(a, b)
        # 1 + cos; an edge folded right back has no smallest rotation and gets a finite one.
        room = np.maximum(1 + np.einsum("...i,...i->...", a, b), 1e-6)[..., None]
        result[..., i, :] = np.einsum("...ij,...j->...i", axes, 2 * axis / np.sqrt(2 * room))
        once = np.cross(axis[..., None, :], axes)
        axes = axes + once + np.cross(axis[..., None, :], once) / room[..., None]
    return result
