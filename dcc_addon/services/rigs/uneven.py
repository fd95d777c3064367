# SPDX-License-Identifier: GPL-3.0-or-later
"""Bones with a different scale along each axis, as from stretch and squash: how much of that a chain of joints can represent,
each with a translation, a rotation and three scales relative to its parent.

Below a stretched bone, a bone that turns and inherits the full scale is sheared in the world but not relative to its
parent; one that inherits nothing, or is turned by constraints, is sheared relative to its parent but not in the world.
"""

import numpy as np

from neuralocks_core.rotation import inverses

UNEVEN = 1e-4
"""Scales that differ by less than this, relative to their mean, are equal."""
SHEAR = 1e-3
"""Axes with a smaller cosine between them count as at right angles."""
ROUNDED = 5e-3
"""So do axes with a smaller cosine than this, if half-precision scales have turned them."""


def uneven(transforms: np.ndarray, even: np.ndarray) -> np.ndarray:
    """Which transforms (..., 4, 4) differ from `even` (..., 4, 4), the same with one scale each."""
    size = np.linalg.norm(even[..., :3, 0], axis=-1)
    return np.abs(transforms[..., :3, :3] - even[..., :3, :3]).max(axis=(-1, -2)) > UNEVEN * size


def carriable(joints: np.ndarray, even: np.ndarray, parents: np.ndarray, head: int | None) -> np.ndarray:
    """Transforms (T, J, 4, 4) of which a chain can carry the head as it is: if one on the way up from it would be sheared, all
    above that one have one scale. Other joints are unchanged; see `nearest`.

    Args:
        joints: world transforms (T, J, 4, 4); even: the same with one scale each.
        parents: (J,) int, -1 for a root.
        head: the joint that carries the hair, if there is one.
    """
    result, whole = joints.copy(), np.ones(len(joints), bool)
    above = -1 if head is None else head
    while above >= 0:
        result[~whole, above] = even[~whole, above]
        joint, above = above, parents[above]
        if above >= 0:
            whole = whole & ~sheared(inverses(joints[:, above]) @ joints[:, joint])
    return result


def sheared(transforms: np.ndarray, cosine: float = SHEAR) -> np.ndarray:
    """Which transforms (..., 4, 4) have axes that are not at right angles, with a cosine between them larger than this."""
    axes = transforms[..., :3, :3] / np.linalg.norm(transforms[..., :3, :3], axis=-2, keepdims=True)
    cosines = np.swapaxes(axes, -1, -2) @ axes
    return np.abs(cosines - np.eye(3)).max(axis=(-1, -2)) > cosine


def nearest(above: np.ndarray, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (N, 3, 3) and scales (N, 3) of sheared joints relative to their parents, near to what they are in the world: the
    rotation is the best with one scale, the scales are the best with this rotation. An error in one joint does not grow in those
    below it.

    Args:
        above, joints: world transforms (N, 4, 4) of the parents and of the joints.
    """
    above, joints = above[:, :3, :3], joints[:, :3, :3]
    u, _, vt = np.linalg.svd(np.swapaxes(above, -1, -2) @ joints)
    turned = above @ u @ vt
    return u @ vt, (turned * joints).sum(axis=-2) / np.square(turned).sum(axis=-2)
