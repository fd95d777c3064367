# SPDX-License-Identifier: Apache-2.0
"""Background work, in order, on one thread: writing while the next frame is computed."""

import queue
import threading


class WriteBehind:
    """Runs calls one after another on a thread.

    `put` waits until the previous call is done, so that the arrays of only one call are held. The first error of
    a call is raised from the next `put`, or at the end; later calls are then dropped.
    """

    def __init__(self):
        self._calls: queue.Queue = queue.Queue()
        self._free = threading.Semaphore(1)
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="write", daemon=True)

    def put(self, function, *arguments) -> None:
        """Start a call."""
        self._free.acquire()
        if self._error is not None:
            self._free.release()
            raise self._error
        self._calls.put((function, arguments))

    def __enter__(self) -> "WriteBehind":
        self._thread.start()
        return self

    def __exit__(self, kind, error, trace) -> None:
        if kind is not None:
            self._error = self._error or error  # calls that still wait are dropped
        self._calls.put(None)
        self._thread.join()
        if kind is None and self._error is not None:
            raise self._error

    def _run(self) -> None:
        while (call := self._calls.get()) is not None:
            if self._error is None:
                try:
                    function, arguments = call
                    function(*arguments)
                except BaseException as error:
                    self._error = error
            call = arguments = None  # the arrays of a frame are freed before the next may come
            self._free.release()
