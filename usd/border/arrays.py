# SPDX-License-Identifier: Apache-2.0
"""Arrays as USD keeps them, and back: its matrices act on row vectors, its quaternions have the imaginary part first."""

import numpy as np
from pxr import Gf, Vt


def vectors(values: np.ndarray) -> Vt.Vec3fArray:
    """Points, offsets or colours (n, 3) in single precision."""
    return Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, np.float32))


def floats(values: np.ndarray) -> Vt.FloatArray:
    """Numbers in single precision, row after row."""
    return Vt.FloatArray.FromNumpy(np.ravel(values).astype(np.float32))


def integers(values: np.ndarray) -> Vt.IntArray:
    """Whole numbers, row after row."""
    return Vt.IntArray.FromNumpy(np.ravel(values).astype(np.int32))


def column_matrix(matrix: Gf.Matrix4d) -> np.ndarray:
    """A USD matrix (row vectors) as (4, 4) for column vectors."""
    return np.array(matrix, float).T


def row_matrix(matrix: np.ndarray) -> Gf.Matrix4d:
    """A (4, 4) transform for column vectors as a USD matrix."""
    return Gf.Matrix4d(np.asarray(matrix, float).T.tolist())


def row_matrices(matrices: np.ndarray) -> Vt.Matrix4dArray:
    """(N, 4, 4) transforms for column vectors as USD matrices."""
    return Vt.Matrix4dArray.FromNumpy(np.ascontiguousarray(np.swapaxes(np.asarray(matrices, float), -1, -2)))


def quaternions(wxyz: np.ndarray) -> Vt.QuatfArray:
    """Quaternions (J, 4) wxyz as USD keeps them, imaginary part first; one by one, a long shot's would take seconds."""
    return Vt.QuatfArray.FromNumpy(np.ascontiguousarray(np.roll(wxyz, -1, axis=1), np.float32))


def wxyz(values: Vt.QuatfArray) -> np.ndarray:
    """Quaternions (J, 4) wxyz of a Vt.QuatfArray, whose buffer holds the imaginary part first."""
    raw = np.asarray(values)
    if raw.ndim == 2 and raw.shape[1] == 4:
        return raw[:, [3, 0, 1, 2]].astype(float)
    return np.array([(q.GetReal(), *q.GetImaginary()) for q in values], float)
