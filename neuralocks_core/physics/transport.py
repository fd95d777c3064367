# SPDX-License-Identifier: Apache-2.0
"""Frames along a strand: quaternions that turn its root edge into each edge (paper section 3.4.1)."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import normalize, one_hot, pad

FOLD = 1e-6
"""Smallest 1 + cos of a turn: keeps opposite edges finite in value and gradient."""
DIRECT_FOLD = 1e-3
"""The same for `direct_frames`, which meets opposite edges in every curl."""


def turn(a: Tensor, b: Tensor, fold: float = FOLD) -> Tensor:
    """The smallest rotation that takes unit vectors a to b, (..., 3) each -> quaternion wxyz (..., 4)."""
    bottom = (1.0 + (a * b).sum(-1, keepdim=True)).clamp_min(fold)
    vector = torch.linalg.cross(a, b) / (2.0 * bottom).sqrt()
    return torch.cat([(0.5 * bottom).sqrt(), vector], dim=-1)


def product(p: Tensor, q: Tensor) -> Tensor:
    """Quaternion product p q of wxyz quaternions (..., 4)."""
    pw, pv, qw, qv = p[..., :1], p[..., 1:], q[..., :1], q[..., 1:]
    scalar = pw * qw - (pv * qv).sum(-1, keepdim=True)
    return torch.cat([scalar, pw * qv + qw * pv + torch.linalg.cross(pv, qv)], dim=-1)


def conjugate(q: Tensor) -> Tensor:
    """Inverse of unit quaternions wxyz (..., 4)."""
    return torch.cat([q[..., :1], -q[..., 1:]], dim=-1)


def direct_frames(edges: Tensor) -> Tensor:
    """The paper's fast transport: straight from the root edge to each edge.

    Singular where an edge points against the root edge; its gradient there is bounded.

    Args:
        edges: (..., E, 3) unit edges.

    Returns:
        (..., E, 4) quaternions wxyz.
    """
    return turn(edges[..., :1, :].expand_as(edges), edges, DIRECT_FOLD)


def loop_frames(edges: Tensor) -> Tensor:
    """Exact parallel transport along every edge, one after another: (..., E, 3) -> (..., E, 4)."""
    steps = _steps(edges)
    frames = [torch.zeros_like(steps[..., 0, :])]
    frames[0][..., 0] = 1.0
    for i in range(steps.shape[-2]):
        frames.append(product(steps[..., i, :], frames[-1]))
    return torch.stack(frames, dim=-2)


def scan_frames(edges: Tensor) -> Tensor:
    """Exact parallel transport as an inclusive scan of log2(E) batched products: (..., E, 3) -> (..., E, 4).

    The same as `loop_frames`; fewer, larger operations, which suits a GPU.
    """
    first = torch.zeros_like(edges[..., :1, :1])
    identity = torch.cat([first + 1.0, first, first, first], dim=-1)
    frames = torch.cat([identity, _steps(edges)], dim=-2)
    hop = 1
    while hop < frames.shape[-2]:
        frames = torch.cat([frames[..., :hop, :], product(frames[..., hop:, :], frames[..., :-hop, :])], dim=-2)
        hop *= 2
    return frames


def _steps(edges: Tensor) -> Tensor:
    """The turns (..., E - 1, 4) from each edge to the next, all of unit length, since they are multiplied along the strand.

    A zero-length edge continues the one before it. A fold, half a turn about any perpendicular axis, has no gradient.
    """
    steps = turn(edges[..., :-1, :], edges[..., 1:, :])
    if (steps.detach().square().sum(-1) > 0.999).all():  # nearly always, and the rest takes time
        return steps
    there = (edges != 0).any(-1)
    first = there.byte().argmax(-1, keepdim=True)
    source = torch.where(there, torch.arange(edges.shape[-2], device=edges.device), first).cummax(-1).values
    edges = edges.take_along_dim(source[..., None], dim=-2)
    a, b = edges[..., :-1, :], edges[..., 1:, :]
    with torch.no_grad():
        across = torch.linalg.cross(a, one_hot(a.abs().argmin(-1), 3).to(a))
        half = pad(normalize(across, dim=-1), (1, 0))
    return torch.where((a * b).sum(-1, keepdim=True) < FOLD - 1.0, half, turn(a, b))
