# SPDX-License-Identifier: Apache-2.0
"""What a rod at rest gives its solver: lengths, masses, curvature in the twist-free frame, support."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import GRAVITY


@dataclass(frozen=True)
class RestRods:
    """Constants of every strand; all per unit line density, canonical axes."""

    points: np.ndarray
    """(S, K, 3) rest points [m]."""
    length: np.ndarray
    """(S, K) rest length of the edge that ends in each vertex [m]; the root's is 0."""
    mass: np.ndarray
    """(S, K) half the adjacent rest lengths [m]."""
    curl: np.ndarray
    """(S, K, 3) rest bend vector sin(theta/2) * axis at each interior vertex, carried back to the root edge's frame."""
    support: np.ndarray
    """(S, K, 3) force that holds the bind pose [m^2/s^2]; zero where it is switched off."""


def rest_rods(points: np.ndarray, *, rest_support: bool = True) -> RestRods:
    """Measure strands at rest.

    Args:
        points: (S, K, 3) canonical rest points [m], K at least 3.
        rest_support: make the rest shape an equilibrium (docs/architecture.md, Physics); else hair is
            stress free at rest and droops, as in the paper.

    Raises:
        NeuralocksError: wrong shape, not finite, or an edge without length.
    """
    points = np.asarray(points, np.float64)
    if points.ndim != 3 or points.shape[1] < 3 or points.shape[2] != 3:
        raise NeuralocksError(f"rest: shape {points.shape}; give (strands, vertices >= 3, 3)")
    if not np.isfinite(points).all():
        raise NeuralocksError("rest: holds values that are not finite; drop these strands")
    edge = np.diff(points, axis=1)
    edge_length = np.linalg.norm(edge, axis=-1)
    if points.size and edge_length.min() < 1e-7:
        strand = int(np.argmin(edge_length.min(1)))
        raise NeuralocksError(f"rest: strand {strand} has an edge without length; resample it by arc length")
    direction = edge / edge_length[..., None]
    length = np.concatenate([np.zeros_like(edge_length[:, :1]), edge_length], 1)
    mass = 0.5 * (length + np.concatenate([edge_length, np.zeros_like(edge_length[:, :1])], 1))
    support = _support(direction, mass) if rest_support else np.zeros_like(points)
    return RestRods(points, length, mass, _curl(direction), support)


def _curl(direction: np.ndarray) -> np.ndarray:
    """Bend vectors of (S, K-1, 3) unit edges in the root edge's frame, by sequential parallel transport."""
    strands, edges = direction.shape[:2]
    curl = np.zeros((strands, edges + 1, 3))
    frame = np.broadcast_to(np.eye(3), (strands, 3, 3)).copy()
    for i in range(edges - 1):
        a, b = direction[:, i], direction[:, i + 1]
        one_plus_cos = np.maximum(1.0 + (a * b).sum(-1, keepdims=True), 1e-6)
        bend = np.cross(a, b) / np.sqrt(2.0 * one_plus_cos)
        curl[:, i + 1] = np.einsum("sji,sj->si", frame, bend)
        frame = np.einsum("sij,sjk->sik", _rotation(bend, np.sqrt(0.5 * one_plus_cos)), frame)
    return curl


def _rotation(vector: np.ndarray, scalar: np.ndarray) -> np.ndarray:
    """(S, 3, 3) rotation matrices of quaternions with imaginary part (S, 3) and real part (S, 1)."""
    norm = np.sqrt((vector**2).sum(-1, keepdims=True) + scalar**2)
    x, y, z = np.moveaxis(vector / norm, -1, 0)
    w = (scalar / norm)[:, 0]
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _support(direction: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """The part of each vertex's own weight that tension along the strand cannot carry, (S, K, 3)."""
    support = np.zeros((*mass.shape, 3))
    pull = np.zeros((len(mass), 3))
    for i in range(mass.shape[1] - 1, 0, -1):
        load = pull + mass[:, i, None] * GRAVITY
        edge = direction[:, i - 1]
        carried = np.maximum((load * edge).sum(-1, keepdims=True), 0.0) * edge
        support[:, i] = carried - load
        pull = carried
    return support
