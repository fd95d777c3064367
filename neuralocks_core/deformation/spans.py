# SPDX-License-Identifier: Apache-2.0
"""A groom's own vertices as weighted means of the network's vertices around them, so that they move along."""

from __future__ import annotations

import numpy as np

NODES = 4
"""Consecutive network vertices that an own vertex is a mean of."""

LEFT_OVER = 5e-5
"""[m] Largest error of a mean at an own vertex, half a hair's width; this rest is carried along unturned."""

LARGEST = 0.5
"""Largest correction of a weight. A strand that needs more has detail finer than the network's vertices (such as a coil)."""

_STIFFNESS = 0.01
"""Regularises corrections: each costs this share of a segment's length."""


def weights(rest: np.ndarray, own: np.ndarray, strand: np.ndarray, place: np.ndarray):
    """Weights of four consecutive network vertices for each own vertex.

    They begin as a Catmull-Rom spline's, straight in the clamped first segment. If a groom's own corner lies off that curve,
    they get the smallest correction, of sum zero, that moves the curve there: means of weight one follow any rigid or affine
    motion of the network's vertices exactly, so the corner turns with its surroundings.

    Args:
        rest: (S, K, 3) [m] network vertices.
        own: (P, 3) [m] own vertices, same axes.
        strand: (P,) which strand each belongs to.
        place: (P,) in [0, K - 1], position along it in network segments.

    Returns:
        first (P,) int32, the first of the four; weights (P, 4) float32; fine (S,) bool, strands that cannot be represented
            like this.
    """
    count = rest.shape[1]
    first, curve = _spline(place, count)
    flat, at = rest.reshape(-1, 3).astype(np.float64), strand * count + first
    missed = own - sum(curve[:, node, None] * flat[at + node] for node in range(NODES))
    missed[place < 1.0] = 0.0  # nothing turns in the clamped segment
    far = np.zeros(len(rest), bool)
    far[strand[np.einsum("pi,pi->p", missed, missed) > (0.2 * LEFT_OVER) ** 2]] = True
    chosen = np.flatnonzero(far[strand])
    size = np.linalg.norm(np.diff(rest, axis=1), axis=2).mean(axis=1)[strand[chosen]]
    corners = flat[at[chosen, None] + np.arange(NODES)]
    change, left = _correction(corners, missed[chosen], _STIFFNESS * size)
    curve[chosen] += change.T
    fine = np.zeros(len(rest), bool)
    fine[strand[chosen[(left > LEFT_OVER) | (np.abs(change) > LARGEST).any(axis=0)]]] = True
    return first, curve.astype(np.float32), fine


def _spline(place: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """First vertex (P,) int32 and weights (P, 4): Catmull-Rom, parabolas at both ends, a line in the first segment."""
    segment = np.clip(place.astype(np.int32), 0, count - 2)
    first = np.clip(segment - 1, 0, count - NODES).astype(np.int32)
    t = np.clip(place - segment, 0.0, 1.0)
    result = np.empty((len(place), NODES))
    result[:, 0] = t * (-0.5 + t * (1.0 - 0.5 * t))
    result[:, 1] = 1.0 + t * t * (1.5 * t - 2.5)
    result[:, 2] = t * (0.5 + t * (2.0 - 1.5 * t))
    result[:, 3] = t * t * (0.5 * t - 0.5)
    for at, since in ((1, 0.0), (count - 2, 1.0)):
        here = segment == at
        x = t[here] + since
        result[here, 0] = 0.0
        result[here, 1:] = np.stack([0.5 * (1 - x) * (2 - x), x * (2 - x), 0.5 * x * (x - 1)], axis=1)
    clamped = segment == 0
    result[clamped] = 0.0
    result[clamped, 0], result[clamped, 1] = 1.0 - t[clamped], t[clamped]
    return first, result


def _correction(corners: np.ndarray, missed: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Smallest changes of weights (4, n), of sum zero, that reach `missed` (n, 3), and the remaining distance (n,) [m].

    Minimises |C^T w - r|^2 + size^2 |w|^2, C the corners (n, 4, 3) about their mean: w = C y, (C^T C + size^2) y = r.
    """
    # One array per coordinate, and the inverse of a symmetric 3x3 matrix written out: a hundred times faster than row by
    # row.
    x, y, z = np.moveaxis(corners, (2, 1), (0, 1)).copy()
    for a in (x, y, z):
        a -= 0.25 * (a[0] + a[1] + a[2] + a[3])
    p, q, r = np.ascontiguousarray(missed.T)
    own = size**2 + 1e-20
    xx, yy, zz = (np.einsum("kp,kp->p", a, a) + own for a in (x, y, z))
    xy, xz, yz = (np.einsum("kp,kp->p", a, b) for a, b in ((x, y), (x, z), (y, z)))
    aa, bb, cc = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    ab, ac, bc = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - yz * xx
    scale = 1.0 / (xx * aa + xy * ab + xz * ac)
    along = (aa * p + ab * q + ac * r) * scale, (ab * p + bb * q + bc * r) * scale, (ac * p + bc * q + cc * r) * scale
    change = x * along[0] + y * along[1] + z * along[2]
    left = sum((m - np.einsum("kp,kp->p", change, a)) ** 2 for m, a in ((p, x), (q, y), (r, z)))
    return change, np.sqrt(left)
