# SPDX-License-Identifier: Apache-2.0
"""A disk that fills up while something is written."""

from contextlib import contextmanager

import pytest


@contextmanager
def room_for(size: int):
    """In this block, no file grows beyond `size` bytes; skips the test if the system has no such limit."""
    resource = pytest.importorskip("resource", reason="limits of file sizes are of Unix")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
