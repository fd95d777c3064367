# SPDX-License-Identifier: Apache-2.0
"""The force that makes a groom's rest shape an equilibrium."""

import numpy as np

from neuralocks_core.motion import GRAVITY


def rest_force(direction: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """The part of each vertex's own weight that tension along the strand cannot carry.

    A groom is modelled with gravity already in it, so the paper's stress-free rest shape would droop a second
    time. Counting the tension from tip to root, `T_i = max(0, (T_{i+1} e_{i+1} + m g) . e_i)`, the support is
    `T_i e_i - T_{i+1} e_{i+1} - m g`: zero for hair that hangs straight, the whole weight for hair that
    stands. Source: docs/architecture.md; the paper's choice is to have none.

    Args:
        direction: unit edges (..., S, K - 1, 3) at rest, canonical, root first.
        mass: (..., S, K) [m], per unit line density.

    Returns:
        (..., S, K, 3) force per unit line density, fixed in head axes [m^2/s^2]; the root's is zero.
    """
    weight = mass[..., None] * GRAVITY.astype(mass.dtype)
    support, pull = np.zeros_like(weight), np.zeros_like(weight[..., 0, :])
    for i in range(mass.shape[-1] - 1, 0, -1):
        load, along = pull + weight[..., i, :], direction[..., i - 1, :]
        pull = np.maximum((load * along).sum(-1, keepdims=True), 0) * along
        support[..., i, :] = pull - load
    return support
