# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C, a farm's SIGTERM, or the SIGHUP of a terminal that is closed ends a command at any time. While USD loads its modules,
it swallows the signal or turns it into an error, and libraries that draw may crash.
"""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

INTERRUPTED = 130
"""Exit status after Ctrl-C; as shells have it, 128 and the signal's number."""
_ENDS = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
"""Signals that end a command, and their default handlers."""
if hasattr(signal, "SIGHUP"):  # not on Windows; under nohup it stays ignored
    _ENDS[signal.SIGHUP] = signal.SIG_DFL

_number = 0
"""Number of the signal that came, 0 for none."""
_deferring = False


@contextmanager
def stoppable() -> Iterator[None]:
    """In this block, a signal that ends a command, and any error it leads to, ends the program with one word; blocks may be
    nested.
    """
    global _number
    with _heeded():
        try:
            yield
        except BaseException as error:
            if not (stopped() or isinstance(error, KeyboardInterrupt)):
                raise
            status = 128 + _number if _number else INTERRUPTED
            _number = 0  # the block around this one has nothing more to say
            with suppress(OSError):  # the terminal may be gone
                print("stopped", file=sys.stderr)
            raise SystemExit(status) from None


@contextmanager
def deferred() -> Iterator[None]:
    """In this block, Ctrl-C waits for the next `check` or the block's end: it would leave compiled modules half loaded."""
    global _deferring
    before, _deferring = _deferring, True
    try:
        yield
    finally:
        _deferring = before
    check()


def end_at_once() -> None:
    """From here on Ctrl-C kills: what is left is the ending of Python, which tells it in a traceback."""
    main = threading.current_thread() is threading.main_thread()
    if main and signal.getsignal(signal.SIGINT) == signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def stopped() -> bool:
    """Whether Ctrl-C was pressed in a stoppable block."""
    return _number != 0


def check() -> None:
    """Raise KeyboardInterrupt if an earlier one is pending, or was swallowed."""
    if stopped():
        raise KeyboardInterrupt


@contextmanager
def _heeded() -> Iterator[None]:
    """In this block every signal that ends a command is remembered, besides being raised as KeyboardInterrupt."""
    global _number
    main = threading.current_thread() is threading.main_thread()
    own = {number: handler for number, handler in _ENDS.items() if main and signal.getsignal(number) == handler}
    for number in own:
        signal.signal(number, _remember)
    try:
        yield
    finally:
        for number, handler in own.items():
            signal.signal(number, handler)
        if own:
            _number = 0


def _remember(number, frame) -> None:
    global _number
    _number = number
    if not _deferring:
        raise _Pressed


class _Pressed(KeyboardInterrupt):
    """Python itself looks for the plain one: where that leaves code that was given as text, as dataclasses are made, the process
    later ends as if killed by Ctrl-C, whatever its exit status.
    """
