# SPDX-License-Identifier: Apache-2.0
"""How deep strands lie below moving skin, whose samples reach only to some depth."""

import numpy as np


def depths_along(points: np.ndarray, distance: np.ndarray, way: np.ndarray) -> None:
    """Fill in distances that are infinite inside the body, from the skin through which a strand enters or leaves it.

    Far outside, distances are infinite too. The neighbouring vertex tells the two apart: if it is inside, its plane holds for
    the next vertex as well. If planes from both ends reach a vertex, the nearer one is its way out.

    Args:
        points: strands (K, 3, n) [m], vertices first.
        distance: (K, n) [m], changed in place where it is infinite.
        way: direction of each distance (K, 3, n), changed along with it.
    """
    inside, unknown = distance < 0, np.isinf(distance)
    rows = np.flatnonzero((unknown[1:] & inside[:-1] | unknown[:-1] & inside[1:]).any(axis=0))
    if not len(rows):  # nearly always: no hair lies deep
        return
    some, depth, out = points[:, :, rows], distance[:, rows], way[:, :, rows]
    inward, outward = (depth.copy(), out.copy()), (depth[::-1].copy(), out[::-1].copy())
    _go_on(some, *inward)
    _go_on(some[::-1], *outward)
    back, back_out = outward[0][::-1], outward[1][::-1]
    # If only one end reaches a vertex, the other has left it infinite.
    other = np.isinf(inward[0]) | (np.isfinite(back) & (back > inward[0]))
    distance[:, rows] = np.where(other, back, inward[0])
    way[:, :, rows] = np.where(other[:, None], back_out, inward[1])


def _go_on(points: np.ndarray, depth: np.ndarray, out: np.ndarray) -> None:
    """Extend the plane of each vertex inside to the next vertices, until one is known or is not below it."""
    for i in range(1, len(points)):
        on = np.flatnonzero(np.isinf(depth[i]) & (depth[i - 1] < 0))
        step = points[i][:, on] - points[i - 1][:, on]
        lower = depth[i - 1, on] + (out[i - 1][:, on] * step).sum(axis=0)
        on, lower = on[lower < 0], lower[lower < 0]
        depth[i, on] = lower
        out[i][:, on] = out[i - 1][:, on]
