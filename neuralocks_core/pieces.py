# SPDX-License-Identifier: Apache-2.0
"""Pieces of a mesh that hang together."""

import numpy as np


def connected_pieces(faces: np.ndarray, count: int) -> np.ndarray:
    """Number of the piece that each of `count` vertices is in (V,) int; faces (F, n) have n corners each."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first, second = faces[:, :-1].ravel(), faces[:, 1:].ravel()
    links = coo_array((np.ones(len(first), bool), (first, second)), (count, count))
    return connected_components(links, directed=False)[1]
