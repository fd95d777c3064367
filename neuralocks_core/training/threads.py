# SPDX-License-Identifier: Apache-2.0
"""The number of torch threads."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def threads(count: int) -> Iterator[None]:
    """In this block, or in a function that it decorates, torch uses this many threads, and afterwards as many as before.

    Threads that share small matrices wait for each other. If other programs also want the cores, they do little else: the
    tiny network of a rig then takes seven to twenty times as long in two threads as in one.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
