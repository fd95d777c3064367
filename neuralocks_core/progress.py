# SPDX-License-Identifier: Apache-2.0
"""How long work reports its progress, and is stopped."""

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called now and then with (done, total, message); an exception that it raises stops the work."""


def silent(done: int, total: int, message: str) -> None:
    """The Progress of work that nobody watches."""


def within(say: Progress, begin: int, end: int) -> Progress:
    """The Progress of a part of longer work, from `begin` to `end` in thousandths of the whole."""
    return lambda done, total, message: say(begin + (end - begin) * done // total, 1000, message)
