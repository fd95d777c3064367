# SPDX-License-Identifier: Apache-2.0
"""Buffers that a thread keeps from one chunk of work to the next."""

import math
import threading

import numpy as np

KEPT = 2**20
"""Most numbers that a thread keeps for one purpose."""
SHAPES = 16
"""So many lots of shapes are remembered."""


class Scratch(threading.local):
    """Arrays for one purpose, the same memory each time a thread asks for it: a groom's chunks are alike, and memory that is
    asked for anew costs more than what is computed in it.
    """

    def __init__(self) -> None:
        self._memory = np.empty(0, np.float32)
        self._known: dict[tuple[tuple[int, ...], ...], list[np.ndarray]] = {}

    def arrays(self, *shapes: tuple[int, ...]) -> list[np.ndarray]:
        """A float32 array of each shape; what is in it is anything, and it is overwritten after this thread's next
        call, be that for other shapes.
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


in_turn = Scratch()
"""For steps that follow each other in a chunk, none of which needs what another had here: all together then touch hardly more
than a core's second-level cache holds.
"""
