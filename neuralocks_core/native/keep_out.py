# SPDX-License-Identifier: Apache-2.0
"""`keep_out.c` on numpy's arrays: hair kept out of a body in a pose."""

import ctypes
from collections.abc import Mapping
from ctypes import c_int64

import numpy as np

from neuralocks_core.native.body import MOST_NEIGHBOURS, VERTICES, at, filled
from neuralocks_core.native.library import library


class KeepOut:
    """One body in one pose. Both functions give the bits of the numpy ones that they stand in for.

    Args:
        fields: of `Body` in `body.h`, arrays in the layout given there.
    """

    def __init__(self, fields: Mapping[str, object]):
        self._body, self._kept = filled(fields)

    @staticmethod
    def serves(vertices: int, neighbours: int) -> bool:
        """Whether there is compiled code for this machine, strands of so many vertices, and skin of so many neighbours."""
        return vertices == VERTICES and neighbours <= MOST_NEIGHBOURS and library() is not None

    def keep_out(self, displacement, rest, keep, watch) -> None:
        """As `laying.keep_out`; the displacement must be contiguous, and float32."""
        rest, keep = (np.ascontiguousarray(each, np.float32) for each in (rest, keep))
        watch = np.ascontiguousarray(watch, np.uint8)
        arrays = map(at, (rest, displacement, keep, watch))
        library().neuralocks_keep_out(ctypes.byref(self._body), *arrays, c_int64(len(rest)))

    def laid(self, points: np.ndarray, keep: np.ndarray) -> np.ndarray:
        """As `laying.resolved`."""
        result, keep = np.array(points, np.float32, order="C"), np.ascontiguousarray(keep, np.float32)
        library().neuralocks_lay(ctypes.byref(self._body), at(result), at(keep), c_int64(len(result)))
        return result
