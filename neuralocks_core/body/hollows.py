# SPDX-License-Identifier: Apache-2.0
"""Hollows of a head that hair must not enter: the mouth, nostrils, the space behind the eyes."""

import numpy as np

from neuralocks_core.body.tree_search import search, surface_tree

BALL = 0.004
"""A ball of this radius [m] cannot get into a hollow from outside: wider than open lips, narrower than an ear's folds."""
CREASE = 0.0015
"""How much farther than such a ball hair may get into a crease [m]; also the error of distances to a grid's nodes."""
NEIGHBOURS = 8
"""Nodes among which the nearest ball is searched for."""


def filled(value: np.ndarray, cell: float) -> np.ndarray:
    """Signed distances (X, Y, Z) [m] on a grid of nodes `cell` [m] apart, with hollows counted as inside.

    Otherwise, hair that goes through a cheek would leave by the mouth: part of a strand would be pushed out, part of it in.
    Where no hollow is near, distances stay unchanged, except by a millimetre at a few nodes inside.
    """
    from scipy import ndimage

    free = np.pad(value >= BALL, 1, constant_values=True)
    number = ndimage.label(free)[0]
    outside = (number == number[0, 0, 0])[1:-1, 1:-1, 1:-1]
    if not outside.any():
        return value
    rim = outside & ~ndimage.binary_erosion(outside, np.ones((3, 3, 3)), border_value=1)
    if not rim.any():
        return value
    # The outside is all balls around free nodes that touch the skin; in most places, one ball is enough.
    nodes, asked = np.argwhere(rim), np.argwhere(~outside)
    nearest = ndimage.distance_transform_edt(~rim, return_distances=False, return_indices=True)[(slice(None), *asked.T)]
    depth = cell * np.linalg.norm(asked - nearest.T, axis=1) - value[tuple(nearest)] - CREASE
    asked = asked[-depth < value[~outside]]  # the others stay as they are: the best ball is no farther than this one
    result = value.copy()
    if len(asked):
        far, which = search(surface_tree(cell * nodes), cell * asked, np.arange(1, min(NEIGHBOURS, len(nodes)) + 1))
        depth = (far - value[rim][which]).min(axis=1) - CREASE
        result[tuple(asked.T)] = np.minimum(value[tuple(asked.T)], -depth)
    return result
