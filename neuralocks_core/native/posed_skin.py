# SPDX-License-Identifier: Apache-2.0
"""`posed_skin.c` on numpy's arrays: moving skin posed and entered in a grid."""

import ctypes
from ctypes import c_double, c_int64

import numpy as np

from neuralocks_core.native.body import Box, at
from neuralocks_core.native.library import library


def pose_skin(box, low, high, points, corners, part, marks) -> tuple[np.ndarray, np.ndarray]:
    """`planes` and `start` of a `moving_skin.PosedSkin`.

    Args:
        box: a `moving_skin.Box`.
        low, high: corners (3,) float32 [m] of the space where samples must lie to be entered.
        points: of the mesh in this pose (V, 3) [m].
        corners: of each sample's triangle (N, 3) int32.
        part: where the sample lies on it (N, 2) float32.
        marks: of the cells (box.count,) uint8, changed.
    """
    points, count = np.ascontiguousarray(points, np.float32), len(corners)
    planes, start, own = np.empty((count, 6), np.float32), np.empty(box.count, np.int32), np.empty((2, count), np.int32)
    library().neuralocks_pose_skin(
        ctypes.byref(Box.of(box)), c_double(box.cell), *map(at, (low, high, points, corners, part)),
        c_int64(count), *map(at, (own, planes, start, marks)),
    )  # fmt: skip
    return planes, start
