# SPDX-License-Identifier: Apache-2.0
"""Background work, in order, on one thread: writing while the next frame is computed."""

from concurrent.futures import Future, ThreadPoolExecutor


class WriteBehind:
    """Runs calls one after another on a thread, not more than one ahead.

    The error of a call is raised from the next `put`, or at the end.
    """

    def __init__(self):
        self._thread = ThreadPoolExecutor(1, "write")
        self._latest: Future | None = None

    def put(self, function, *arguments) -> None:
        """Start a call once the previous one is done."""
        self._wait()
        self._latest = self._thread.submit(function, *arguments)

    def __enter__(self) -> "WriteBehind":
        return self

    def __exit__(self, kind, error, trace) -> None:
        self._thread.shutdown(cancel_futures=kind is not None)
        if kind is None:
            self._wait()

    def _wait(self) -> None:
        if self._latest is not None:
            self._latest.result()
