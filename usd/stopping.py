# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C ends a command whatever it meets: USD, while it loads its modules, swallows it or makes an error of it."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_pressed = threading.Event()


@contextmanager
def heeded() -> Iterator[None]:
    """In this block every Ctrl-C is remembered, besides being raised as KeyboardInterrupt."""
    own = threading.current_thread() is threading.main_thread()
    own = own and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if own:
        signal.signal(signal.SIGINT, _remember)
    try:
        yield
    finally:
        if own:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            _pressed.clear()


def stopped() -> bool:
    """Whether Ctrl-C was pressed in the block."""
    return _pressed.is_set()


def check() -> None:
    """Raise KeyboardInterrupt if an earlier one was swallowed."""
    if stopped():
        raise KeyboardInterrupt


def _remember(number, frame) -> None:
    _pressed.set()
    raise KeyboardInterrupt
