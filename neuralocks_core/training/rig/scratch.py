# SPDX-License-Identifier: Apache-2.0
"""Buffers that a thread keeps from one chunk of work to the next."""

import math
import threading

import numpy as np

KEPT = 2**20
"""Most numbers that a thread keeps for one purpose."""
SHAPES = 16
"""Number of sets of shapes that are remembered."""


class Scratch(threading.local):
    """Arrays for one purpose, in the same memory each time a thread asks: a groom's chunks are alike, and allocating memory
    costs more than the computation in it.
    """

    def __init__(self) -> None:
        self._memory = np.empty(0, np.float32)
        self._known: dict[tuple[tuple[int, ...], ...], list[np.ndarray]] = {}

    def arrays(self, *shapes: tuple[int, ...]) -> list[np.ndarray]:
        """A float32 array of each shape, with arbitrary content; it is overwritten after this thread's next call, even one for
        other shapes.
        """
        if shapes in self._known:
            return self._known[shapes]
        sizes = [math.prod(shape) for shape in shapes]
        memory, ends = self._memory, np.cumsum(sizes)
        if ends[-1] > len(memory):
            memory = np.empty(ends[-1], np.float32)
        arrays = [memory[e - n : e].reshape(shape) for e, n, shape in zip(ends, sizes, shapes)]
        if len(memory) <= KEPT:
            if memory is not self._memory or len(self._known) == SHAPES:
                self._memory, self._known = memory, {}
            self._known[shapes] = arrays
        return arrays
