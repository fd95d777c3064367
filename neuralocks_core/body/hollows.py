# SPDX-License-Identifier: Apache-2.0
"""Hollows of a head that hair must not enter: the mouth, nostrils, the space behind the eyes."""

import numpy as np

BALL = 0.004
"""Where a ball of this radius cannot get to from outside is a hollow [m]: wider than lips are open, narrower than an ear's folds."""
CREASE = 0.0015
"""How much farther than such a ball hair may get into a crease [m]; also what distances to a grid's nodes are wrong by."""
NEIGHBOURS = 8
"""Nodes among which the nearest ball is looked for."""


def filled(value: np.ndarray, cell: float) -> np.ndarray:
    """Signed distances (X, Y, Z) [m] on a grid of nodes `cell` [m] apart, with hollows as inside.

    Hair that goes through a cheek would else leave by the mouth: part of a strand would be pushed out, part of it in.
    Where no hollow is near, distances stay as they are, but for a millimetre in few of the nodes inside.
    """
    from scipy import ndimage
    from scipy.spatial import cKDTree

    free = np.pad(value >= BALL, 1, constant_values=True)
    number = ndimage.label(free)[0]
    outside = (number == number[0, 0, 0])[1:-1, 1:-1, 1:-1]
    if not outside.any():
        return value
    rim = outside & ~ndimage.binary_erosion(outside, np.ones((3, 3, 3)), border_value=1)
    if not rim.any():
        return value
    # What is outside is all balls around free nodes that touch the skin; one is enough in most places.
    nodes = np.argwhere(rim)
    asked = ~outside
    far, which = cKDTree(cell * nodes).query(cell * np.argwhere(asked), k=np.arange(1, min(NEIGHBOURS, len(nodes)) + 1))
    depth = (far - value[rim][which]).min(axis=1) - CREASE
    result = value.copy()
    result[asked] = np.minimum(value[asked], -depth)
    return result
