# SPDX-License-Identifier: Apache-2.0
"""A progress bar with the time left, for what takes more than two seconds; in a log, a line now and then."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from neuralocks_core.time_left import TimeLeft

from ..border.stopping import check

QUIET_FOR = 2.0
"""[s] Work that is done by then shows no bar."""
LOG_EVERY = 20.0
"""[s] Between two lines if stderr is not a terminal."""


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[..., None]]:
    """A callback (done, total, message) that draws on stderr, or writes lines if that is not a terminal.

    It raises KeyboardInterrupt if work went on after an earlier one.
    """
    shown = _Bar(title) if sys.stderr.isatty() else _Log(title)

    def say(done: int, total: int, message: str = "") -> None:
        check()
        shown(done, total, message)

    try:
        yield say
    finally:
        shown.close()


class _Log:
    """A line now and then, with the time left at the speed so far."""

    def __init__(self, title: str):
        self._title, self._written = title, time.monotonic()
        # A bake's first frame takes as long as a hundred others; from it alone the estimate would be hours.
        self._left = TimeLeft(enough=0.01, after=0.0)

    def __call__(self, done: int, total: int, message: str = "") -> None:
        now = time.monotonic()
        self._left.told(done, total, now)
        if now - self._written <= LOG_EVERY:
            return
        self._written, seconds = now, self._left.seconds
        left = "" if seconds is None else f", {seconds / 60:.1f} min left"
        print(f"{self._title}: {done / max(total, 1):.0%}{left} {message}", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Nothing to close."""


class _Bar:
    """A bar in the terminal, shown after QUIET_FOR; each new step restarts it."""

    def __init__(self, title: str):
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.table import Column
        from rich.text import Text

        class Left(TimeRemainingColumn):
            def render(self, task):
                return Text("left ").append_text(super().render(task))

        # With fixed widths, share and time stay whole if a narrow terminal cuts the others short.
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:>3.0f} %", table_column=Column(no_wrap=True, min_width=5)),
            TimeElapsedColumn(),
            Left(table_column=Column(no_wrap=True, min_width=13)),
            TextColumn("{task.fields[message]}"),
        )
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._title, self._began = title, time.monotonic()
        self._task, self._last = None, (0, -1)

    def __call__(self, done: int, total: int, message: str = "") -> None:
        another = total != self._last[1] or done < self._last[0]
        self._last = done, total
        if self._task is None:
            if time.monotonic() - self._began < QUIET_FOR:
                return
            self._bar.start()
            self._task = self._bar.add_task(self._title, total=total, message="")
        elif another:
            self._bar.reset(self._task, total=total)
        self._bar.update(self._task, completed=done, total=total, message=message)

    def close(self) -> None:
        """Remove the bar from the terminal."""
        if self._task is not None:
            self._bar.stop()
