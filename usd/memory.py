# SPDX-License-Identifier: Apache-2.0
"""Memory that is free but still held."""

import ctypes


def give_back() -> None:
    """Return freed memory to the system after a large preparation; only the GNU C library needs to be told."""
    try:
        ctypes.CDLL(None).malloc_trim(0)
    except (AttributeError, OSError, TypeError):  # another C library, or Windows
        pass
