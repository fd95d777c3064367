# SPDX-License-Identifier: Apache-2.0
"""What the solver needs from a rod at rest: lengths, masses, curvature in the twist-free frame, support."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.arguments import flag, number_array
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.strands.bends import bends
from neuralocks_core.strands.rest_support import rest_force


@dataclass(frozen=True, eq=False)
class RestRods:
    """Constants of every strand; all per unit line density, canonical axes."""

    points: np.ndarray
    """(S, K, 3) rest points [m]."""
    length: np.ndarray
    """(S, K) rest length of the edge that ends in each vertex [m]; the root's is 0."""
    mass: np.ndarray
    """(S, K) half the adjacent rest lengths [m]."""
    curl: np.ndarray
    """(S, K, 3) rest bend vector sin(theta/2) * axis at each interior vertex, transported back to the root edge's frame."""
    support: np.ndarray
    """(S, K, 3) force that holds the bind pose [m^2/s^2]; zero if switched off."""


def rest_rods(points: np.ndarray, *, rest_support: bool = True) -> RestRods:
    """Measure strands at rest.

    Args:
        points: (S, K, 3) canonical rest points [m], K at least 3.
        rest_support: make the rest shape an equilibrium (docs/architecture.md, Physics); else hair is stress free at
            rest and droops, as in the paper.

    Raises:
        NeuralocksError: wrong shape, not finite, or an edge of zero length.
    """
    rest_support = flag("rest_support", rest_support)
    points = number_array("rest", points, "(S, K, 3) metres")
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
    support = rest_force(direction, mass) if rest_support else np.zeros_like(points)
    curl = np.zeros_like(points)
    curl[:, 1:-1] = bends(direction)
    return RestRods(points, length, mass, curl, support)
