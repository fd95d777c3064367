# SPDX-License-Identifier: Apache-2.0
"""Inertia over one implicit step, and damping (paper section 3.4.5, equation 9)."""

from __future__ import annotations

from torch import Tensor

from neuralocks_core.physics.rods import Rods


def inertia(x: Tensor, before: Tensor, before2: Tensor, rods: Rods, dt: float, *, detach: bool = True) -> Tensor:
    """Energy `1/(2 dt^2) (x - x^)^T M (x - x^)` with `x^ = 2 x_{t-1} - x_{t-2}`.

    All points must be in one frame that does not accelerate: the head's frame at one moment will do, its
    frame at each moment will not.

    Args:
        x: (..., S, K, 3) points now [m].
        before: (..., S, K, 3) points one step ago.
        before2: (..., S, K, 3) points two steps ago.
        rods: the strands at rest.
        dt: step [s].
        detach: no gradient into the past states, as in the paper.

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    if detach:
        before, before2 = before.detach(), before2.detach()
    gap = x - 2.0 * before + before2
    return (rods.mass * gap.square().sum(-1)).sum(-1) / (2.0 * dt * dt)


def damping(moved: Tensor, moved_before: Tensor, rods: Rods, dt: float, rate: float | Tensor) -> Tensor:
    """Energy `c / (2 dt) sum m |x_t - x_{t-1}|^2` in the head's frame, so that rigid motion is not braked.

    The paper has no damping term; implicit integration brakes instead, by an amount that depends on the step.

    Args:
        moved: (..., S, K, 3) points, or displacements, now, in the head's current frame [m].
        moved_before: (..., S, K, 3) the same one step ago, in the head's frame at that time; detached here.
        rods: the strands at rest.
        dt: step [s].
        rate: c [1/s], a number or (..., S, 1).

    Returns:
        (..., S) energy per unit line density [m^3/s^2].
    """
    gap = (moved - moved_before.detach()).square().sum(-1)
    return (rate * rods.mass * gap).sum(-1) / (2.0 * dt)
