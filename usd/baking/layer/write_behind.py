# SPDX-License-Identifier: Apache-2.0
"""Background work, in order: writing while the next frame is computed."""

from concurrent.futures import Future, wait
from threading import Thread


class WriteBehind:
    """Runs calls one after another in the background, not more than one ahead.

    The error of a call is raised from the next `put`, or at the end. If the wait at the end is interrupted, as by a second Ctrl-C,
    the call under way ends with the program.
    """

    def __init__(self):
        self._latest: Future | None = None

    def put(self, function, *arguments) -> None:
        """Start a call once the previous one is done."""
        self._finish()
        call = Future()
        # No ThreadPoolExecutor: Python does not end before its threads do.
        Thread(target=_run, args=(call, function, arguments), name="write", daemon=True).start()
        self._latest = call  # what could not begin would be waited for in vain

    def __enter__(self) -> "WriteBehind":
        return self

    def __exit__(self, kind, error, trace) -> None:
        if kind is None:
            self._finish()
        elif self._latest is not None:
            wait([self._latest])

    def _finish(self) -> None:
        if self._latest is not None:
            self._latest.result()


def _run(future: Future, function, arguments: tuple) -> None:
    try:
        future.set_result(function(*arguments))
    except BaseException as error:
        future.set_exception(error)
