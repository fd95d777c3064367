# SPDX-License-Identifier: Apache-2.0
"""Which pieces of a character's meshes are its own skin, since a hat or a backpack must not count as part of the body."""

import numpy as np

from neuralocks_core.mesh import welded_pieces


def own_skin(
    points: np.ndarray, triangles: np.ndarray, on_head: np.ndarray, on_joint: np.ndarray, least: float
) -> np.ndarray:
    """Which vertices (V,) bool belong to a piece that continues from the head into neck or trunk. If there is none, as on a robot, all
    but pieces that move mainly with joints below the head's, such as pigtails, unless these are all of the head.

    Hats, horns, glasses, eyes and hair on joints of its own move only with the head, backpacks and boots without it. Hair cards,
    scarves and ribbons may continue into the neck, but are not as large as a head along every axis. A hood is, and counts as skin.

    Args:
        points: (V, 3) [m]; triangles: (F, 3).
        on_head: which vertices (V,) move mainly with the head or joints below it.
        on_joint: which vertices (V,) move mainly with the head's own joint.
        least: size of the smallest head, along each axis [m].
    """
    piece = welded_pieces(points, triangles)
    low, high = np.full((2, piece.max() + 1, 3), np.inf)
    np.minimum.at(low, piece[on_head], points[on_head])
    np.minimum.at(high, piece[on_head], -points[on_head])
    large = (-high - low).min(axis=1) >= least
    goes_on = np.bincount(piece[~on_head], minlength=len(low)) > 0
    own = large & goes_on
    if not own.any():
        heads, below = (
            np.bincount(piece[mask], minlength=len(low)) > 0.5 * np.bincount(piece, minlength=len(low))
            for mask in (on_joint, on_head & ~on_joint)
        )
        own = ~below if (large & heads).any() else own
    return own[piece] if own.any() else np.ones(len(points), bool)
