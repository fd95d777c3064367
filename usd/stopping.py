# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C ends a command whatever it meets: USD, while it loads its modules, swallows it or makes an error of it, and VTK
may crash.
"""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

INTERRUPTED = 130

_pressed = threading.Event()
_deferring = False


@contextmanager
def stoppable() -> Iterator[None]:
    """Ctrl-C in this block, and whatever error it led to, ends the program in one word; blocks may lie in each other."""
    with _heeded():
        try:
            yield
        except BaseException as error:
            if not (stopped() or isinstance(error, KeyboardInterrupt)):
                raise
            _pressed.clear()  # the block around this one has nothing more to say
            print("stopped", file=sys.stderr)
            raise SystemExit(INTERRUPTED) from None


@contextmanager
def deferred() -> Iterator[None]:
    """In this block Ctrl-C waits for the next `check`, or for the block's end: compiled modules stay half made where it
    breaks into their loading.
    """
    global _deferring
    before, _deferring = _deferring, True
    try:
        yield
    finally:
        _deferring = before
    check()


def stopped() -> bool:
    """Whether Ctrl-C was pressed in a stoppable block."""
    return _pressed.is_set()


def check() -> None:
    """Raise KeyboardInterrupt if an earlier one waits, or was swallowed."""
    if stopped():
        raise KeyboardInterrupt


@contextmanager
def _heeded() -> Iterator[None]:
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


def _remember(number, frame) -> None:
    _pressed.set()
    if not _deferring:
        raise KeyboardInterrupt
