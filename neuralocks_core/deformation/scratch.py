# SPDX-License-Identifier: Apache-2.0
"""Memory that a thread keeps from one chunk of work to the next."""

import math
import threading

import numpy as np

KEPT = 2**20
"""Most numbers that a thread keeps for one purpose."""


class Scratch(threading.local):
    """Arrays for one purpose, the same memory each time a thread asks for the same shapes: a groom's chunks are alike,
    and memory that is asked for anew costs more than what is computed in it.
    """

    def __init__(self) -> None:
        self._shapes: tuple[tuple[int, ...], ...] = ()
        self._arrays: list[np.ndarray] = []

    def arrays(self, *shapes: tuple[int, ...]) -> list[np.ndarray]:
        """A float32 array of each shape; what is in it is anything, and it is overwritten after this thread's next
        call.
        """
        if shapes != self._shapes:
            sizes = [math.prod(shape) for shape in shapes]
            memory, ends = np.empty(sum(sizes), np.float32), np.cumsum(sizes)
            arrays = [memory[e - n : e].reshape(shape) for e, n, shape in zip(ends, sizes, shapes)]
            if len(memory) > KEPT:
                return arrays
            self._shapes, self._arrays = shapes, arrays
        return self._arrays
