# SPDX-License-Identifier: Apache-2.0
"""Memory that is free but still held; only the GNU C library needs to be told."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of malloc.h
SMALL, LARGE = 1 << 20, 32 << 20
"""Bytes from which on memory is asked of the system by itself: while something is prepared, and else. It costs a third
more time where frames are computed.
"""


@contextmanager
def preparing() -> Iterator[None]:
    """While something large is prepared: what it needed besides its result goes back to the system, in one piece."""
    _tell("mallopt", _MMAP_THRESHOLD, SMALL)
    try:
        yield
    finally:
        _tell("mallopt", _MMAP_THRESHOLD, LARGE)
        _tell("mallopt", _TRIM_THRESHOLD, 2 * LARGE)  # as it would have grown by itself
        _tell("malloc_trim", 0)


def _tell(name: str, *values: int) -> None:
    try:
        getattr(ctypes.CDLL(None), name)(*values)
    except (AttributeError, OSError, TypeError):  # another C library, or Windows
        pass
