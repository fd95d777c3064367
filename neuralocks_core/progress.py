# SPDX-License-Identifier: Apache-2.0
"""How long work tells how far it is, and is stopped."""

from collections.abc import Callable

Progress = Callable[[int, int, str], None]
"""Called now and then with (done, total, message); what it raises stops the work."""


def silent(done: int, total: int, message: str) -> None:
    """The Progress of work that nobody watches."""
