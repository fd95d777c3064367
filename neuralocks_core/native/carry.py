# SPDX-License-Identifier: Apache-2.0
"""`carry.c` on numpy's arrays: a groom's own vertices moved as the network's are."""

import ctypes
import threading
from ctypes import c_int64, c_void_p

import numpy as np

from neuralocks_core.native.body import VERTICES, at
from neuralocks_core.native.library import library

TYPES = {
    "ends": np.int64, "points": np.float32, "still": np.bool_, "facing": np.float32, "first": np.uint8, "weights": np.float32,
    "coil": np.int32, "edges": np.float32, "begin": np.int64, "segment": np.uint8, "share": np.float32, "beside": np.float32,
}  # fmt: skip
"""Fields of a groom in the C file, which point to arrays of these types."""
WORK = 8
"""Numbers of scratch memory for each vertex of a strand."""


class Carry:
    """One groom, for `Carrier`, whose numpy code gives the same bits.

    Args:
        points: own vertices at rest (P, 3) float32 [m].
        ends: of each strand's vertices (S + 1,) int64.
        still: strands that never move (S,) bool.
        facing: rotation from bind axes to the network's (3, 3) float32, if they differ.
        following: how own vertices follow the network's (a `following.Following`); None if they are the same.
    """

    def __init__(self, points, ends, still, facing, following):
        given = {"points": points, "ends": ends, "still": still, "facing": facing}
        self._kept = {
            name: np.ascontiguousarray(array, kind)
            for name, kind in TYPES.items()
            if (array := given[name] if name in given else getattr(following, name, None)) is not None
        }
        self._groom = _Groom(**{name: at(array) for name, array in self._kept.items()})
        self._most = WORK * int(np.diff(ends).max(initial=1))
        self._own = threading.local()

    @staticmethod
    def serves(vertices: int) -> bool:
        """Whether there is compiled code for this machine and so many network vertices on a strand."""
        return vertices == VERTICES and library() is not None

    def carry(self, displacement, start: int, stop: int, placing, onto, out: np.ndarray) -> None:
        """As `Carrier._carried`."""
        if not hasattr(self._own, "work"):
            self._own.work = np.empty(self._most, np.float32)
        displacement = np.ascontiguousarray(displacement)
        onto = None if onto is None else np.ascontiguousarray(onto, np.float32)
        placed = None if placing is None else np.concatenate([np.ravel(each) for each in placing]).astype(np.float32)
        whole = out if out.flags.c_contiguous and out.dtype == np.float32 else np.empty(out.shape, np.float32)
        library().neuralocks_carry(
            ctypes.byref(self._groom), at(displacement), c_int64(start), c_int64(stop),
            None if placed is None else at(placed), None if onto is None else at(onto), at(whole), at(self._own.work),
        )  # fmt: skip
        if whole is not out:
            out[:] = whole


class _Groom(ctypes.Structure):
    """As in the C file."""

    _fields_ = tuple((name, c_void_p) for name in TYPES)
