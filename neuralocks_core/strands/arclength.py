# SPDX-License-Identifier: Apache-2.0
"""Resampling strands of any vertex counts uniformly in arc length."""

from __future__ import annotations

import numpy as np

from neuralocks_core.groom import Groom

SHORTEST = 2e-5
"""A strand shorter than this [m] counts as one point: its 23 edges would be below float32's resolution at a
head's height, and it is shorter than a hair is wide."""


def resample(groom: Groom, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Points that divide each strand into `vertices` - 1 pieces of equal arc length.

    A strand that is already divided like this keeps its own points, bit for bit.

    Args:
        groom: any vertex counts, zero and one included.
        vertices: how many points each strand gets, at least 2.

    Returns:
        points (S, vertices, 3) float64 [m] (where not valid: the root, repeated) and valid (S,) bool.
    """
    own = groom.points.astype(np.float64)
    arc, length = arc_lengths(groom)
    valid = length > SHORTEST
    sampled = np.repeat(own[np.minimum(groom.starts, len(own) - 1)][:, None], vertices, axis=1)

    strands = np.flatnonzero(valid)
    # One ascending key over all strands, strand s covering [s, s + 1], lets one binary search serve all of them.
    share = arc / np.where(valid, length, 1.0)[groom.strand_of_point]
    key = groom.strand_of_point + np.minimum(share, 1.0)
    wanted = np.linspace(0.0, 1.0, vertices)
    last = groom.starts + groom.counts - 2
    after = np.searchsorted(key, (strands[:, None] + wanted).ravel(), side="right").reshape(len(strands), vertices)
    before = np.clip(after - 1, groom.starts[strands, None], last[strands, None])
    span = share[before + 1] - share[before]
    weight = np.clip((wanted - share[before]) / np.where(span > 0, span, 1.0), 0.0, 1.0)[..., None]
    sampled[strands] = own[before] * (1.0 - weight) + own[before + 1] * weight
    sampled[strands, 0] = own[groom.starts[strands]]
    sampled[strands, -1] = own[groom.starts[strands] + groom.counts[strands] - 1]

    _keep_uniform(groom, own, share, valid, sampled)
    return sampled, valid


def arc_lengths(groom: Groom) -> tuple[np.ndarray, np.ndarray]:
    """Arc length from the root to each point (P,) and of each whole strand (S,), float64 [m]."""
    step = np.zeros(len(groom.points))
    step[1:] = np.linalg.norm(np.diff(groom.points.astype(np.float64), axis=0), axis=1)
    filled = groom.counts > 0
    starts = groom.starts[filled]
    step[starts] = 0.0
    walked = np.cumsum(step)
    arc = walked - np.repeat(walked[starts], groom.counts[filled])
    length = np.zeros(groom.strand_count)
    length[filled] = arc[starts + groom.counts[filled] - 1]
    return np.maximum(arc, 0.0), length


def count_pointlike(groom: Groom) -> int:
    """How many strands have no two distinct points (`SHORTEST`)."""
    return int((arc_lengths(groom)[1] <= SHORTEST).sum())


def _keep_uniform(groom: Groom, own: np.ndarray, share: np.ndarray, valid: np.ndarray, sampled: np.ndarray) -> None:
    """Restore a strand's own points if the samples differ from them only by rounding."""
    vertices = sampled.shape[1]
    candidates = np.flatnonzero(valid & (groom.counts == vertices))
    index = groom.starts[candidates, None] + np.arange(vertices)
    uniform = np.abs(share[index] - np.linspace(0.0, 1.0, vertices)).max(axis=1, initial=0.0) < 1e-4
    sampled[candidates[uniform]] = own[index[uniform]]
