# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones with another scale along each axis, as stretch and squash give them: what a chain of joints, each with a
translation, a rotation and three scales relative to its parent, can carry of them.

Below a bone that is stretched, one that turns and inherits all of it is sheared in the world and is not relative to its
parent; one that inherits nothing, or is turned by constraints, is sheared relative to its parent and is not in the world.
"""

import numpy as np

from neuralocks_core.rotation import inverses

UNEVEN = 1e-4
"""Scales that differ by less, relative to their mean, are one."""
SHEAR = 1e-3
"""Axes with a smaller cosine between them are at right angles."""


def uneven(transforms: np.ndarray, even: np.ndarray) -> np.ndarray:
    """Which transforms (..., 4, 4) are more than `even` (..., 4, 4), the same with one scale each."""
    size = np.linalg.norm(even[..., :3, 0], axis=-1)
    return np.abs(transforms[..., :3, :3] - even[..., :3, :3]).max(axis=(-1, -2)) > UNEVEN * size


def carriable(joints: np.ndarray, even: np.ndarray, parents: np.ndarray, levels, head: int | None) -> np.ndarray:
    """Transforms (T, J, 4, 4) that a chain can carry: each joint as it is, or with one scale where it would be sheared, or
    would let the head be. The head itself is as it is.

    Args:
        joints: world transforms (T, J, 4, 4); even: the same with one scale each.
        parents: (J,) int, -1 for a root.
        levels: joints (j,) without a parent, their children, and so on.
        head: the joint that carries the hair, if there is one.
    """
    result, chain, whole = joints.copy(), [], np.ones(len(joints), bool)
    above = -1 if head is None else head
    while above >= 0:
        chain.append(above)
        result[~whole, above] = even[~whole, above]
        joint, above = above, parents[above]
        if above >= 0:
            whole = whole & ~_sheared(inverses(joints[:, above]) @ joints[:, joint])
    for level in levels:
        others = level[~np.isin(level, chain)]
        link, above = joints[:, others], parents[others]
        if len(others) and above[0] >= 0:
            link = inverses(result[:, above]) @ link
        result[:, others] = np.where(_sheared(link)[..., None, None], even[:, others], joints[:, others])
    return result


def _sheared(transforms: np.ndarray) -> np.ndarray:
    """Which transforms (..., 4, 4) have axes that are not at right angles."""
    axes = transforms[..., :3, :3] / np.linalg.norm(transforms[..., :3, :3], axis=-2, keepdims=True)
    cosines = np.swapaxes(axes, -1, -2) @ axes
    return np.abs(cosines - np.eye(3)).max(axis=(-1, -2)) > SHEAR
