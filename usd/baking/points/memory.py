# SPDX-License-Identifier: Apache-2.0
"""Returns freed memory to the system, which the GNU C library otherwise keeps."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of malloc.h
SMALL, LARGE = 1 << 20, 32 << 20
"""Arrays of at least this many bytes are mapped one by one, and go back to the system when they are freed: SMALL while
something large is prepared; LARGE otherwise, because mapping arrays makes frames a third slower.
"""


@contextmanager
def preparing() -> Iterator[None]:
    """For preparing something large: at the end, all memory except the result's is given back."""
    _tell("mallopt", _MMAP_THRESHOLD, SMALL)
    try:
        yield
    finally:
        _tell("mallopt", _MMAP_THRESHOLD, LARGE)
        _tell("mallopt", _TRIM_THRESHOLD, 2 * LARGE)  # as malloc would have raised it by itself
        give_back()


def give_back() -> None:
    """Return memory that is free by now; it takes time to map it again when it is needed."""
    _tell("malloc_trim", 0)


def _tell(name: str, *values: int) -> None:
    try:
        getattr(ctypes.CDLL(None), name)(*values)
    except (AttributeError, OSError, TypeError):  # another C library, or Windows
        pass
