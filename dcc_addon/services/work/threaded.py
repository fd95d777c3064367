# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in its own thread, so that the panel can show progress and cancel; it calls nothing of Blender."""

import importlib
import sys
import threading
import traceback

from neuralocks_core.errors import NeuralocksError


class Threaded:
    """A function that runs beside Blender.

    Args:
        function: called with a progress callback (done, total, message) that raises once the work is cancelled.
        title: what is being done.
        leave: do not wait for the thread after a cancel; for work that ends by itself and writes nothing.

    Attributes:
        done: share that is done, from 0 to 1.
    """

    def __init__(self, function, title: str = "Baking the hair", leave: bool = False):
        self._function, self._title, self._leave = function, title, leave
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._cancelled, self._error, self._result = False, None, None
        self.done = 0.0

    def start(self) -> "Threaded":
        """Begin."""
        self._thread.start()
        return self

    @property
    def running(self) -> bool:
        """Whether it still works."""
        return self._thread.is_alive()

    def cancel(self) -> None:
        """Stop at its next progress report."""
        self._cancelled = True
        if not self._leave:
            self._thread.join()

    def result(self):
        """What the function returned, or the error that it raised."""
        if self._error is not None:
            raise self._error
        return self._result

    def steps(self, begin: float = 0.0, end: float = 1.0):
        """Yields (done, total, title) while it works, from share `begin` to `end` of a longer work; returns its result."""
        self.start()
        try:
            while self.running:
                self._thread.join(0.02)
                yield begin + (end - begin) * self.done, 1, self._title
        finally:
            self.cancel()
        return self.result()

    def _run(self) -> None:
        try:
            self._result = self._function(self._say)
        except BaseException as error:
            # Its stack frames would keep their contents open, such as a stage, and lead back to this object.
            traceback.clear_frames(error.__traceback__)
            self._error = error
        finally:
            del self

    def _say(self, done, total, _message="") -> None:
        if self._cancelled:
            raise NeuralocksError("cancelled")
        self.done = done / max(total, 1)


def loading(*modules: str):
    """Steps (0, 1, message) of importing modules that take seconds to load at first, such as the USD libraries."""
    if not all(module in sys.modules for module in modules):
        load = Threaded(lambda _: [importlib.import_module(module) for module in modules], "Loading USD", leave=True)
        yield from load.steps(0.0, 0.0)
