# SPDX-License-Identifier: Apache-2.0
"""A lock between processes, which ends with the one that holds it, however that ends."""

import os
from typing import TextIO

try:
    import fcntl
except ImportError:  # Windows: two at a time are then not told apart
    fcntl = None


def locked(path: str | os.PathLike) -> TextIO:
    """The file, made if it is missing; the lock is held until it is closed.

    Raises:
        BlockingIOError: another process holds it.
        OSError: the file cannot be made.
    """
    file = open(path, "a+")
    try:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        file.close()
        raise
    return file
