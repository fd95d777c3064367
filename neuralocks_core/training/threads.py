# SPDX-License-Identifier: Apache-2.0
"""The number of torch threads."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def threads(count: int) -> Iterator[None]:
    """In this block, or in a function that it decorates, torch works in so many threads, and afterwards in as many as before.

    Threads that share small matrices wait for each other. Where other programs want the cores as well, that is nearly all
    that they do: the tiny network of a rig then takes seven to twenty times as long in two threads as in one.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
