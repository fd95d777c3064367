# SPDX-License-Identifier: GPL-3.0-or-later
"""The other half of a body that is modelled as one half."""

from dataclasses import replace

import numpy as np

from neuralocks_core.rotation import transformed

from .rig import BodyArrays


def mirrored(body: BodyArrays, reflection: np.ndarray, partner: np.ndarray, merge: float = -1.0) -> BodyArrays:
    """The body and its mirror image, joined along the seam.

    Args:
        body: with points (V, 3) in its own space.
        reflection: (4, 4) in that space.
        partner: for each vertex group, the group of its mirror image, (G,) int.
        merge: vertices nearer than this to their image, in the body's unit, are merged with it; none if negative.

    Returns:
        body with up to 2 V points.
    """
    count, image = len(body.points), transformed(body.points, reflection)
    new = np.linalg.norm(image - body.points, axis=1) > merge
    index = np.where(new, count + np.cumsum(new) - 1, np.arange(count))
    weights = body.weights
    if len(weights):
        own = weights[new[weights[:, 0].astype(int)]]
        other = np.column_stack([index[own[:, 0].astype(int)], partner[own[:, 1].astype(int)], own[:, 2]])
        weights = np.concatenate([weights, other])
    turn = reflection[:3, :3]
    return replace(
        body,
        points=np.concatenate([body.points, image[new]]),
        triangles=np.concatenate([body.triangles, index[body.triangles][:, ::-1]]),
        weights=weights,
        shapes={name: np.concatenate([offsets, offsets[new] @ turn.T]) for name, offsets in body.shapes.items()},
    )
