# SPDX-License-Identifier: Apache-2.0
"""A progress bar with the time left, for what takes more than two seconds; in a log, a line now and then."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

QUIET_FOR = 2.0
"""[s] Work that is done by then shows no bar."""
LOG_EVERY = 20.0
"""[s] Between two lines where stderr is no terminal."""


@contextmanager
def progress_bar(title: str) -> Iterator:
    """A callback (done, total, message) that draws on stderr."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[message]}"),
    )
    bar = Progress(*columns, console=console, transient=True)
    began, shown = time.monotonic(), None
    # A resumed job begins in the middle, and one step follows another: only what is done of this step tells the speed.
    logged, since, first, last = began, began, None, (0, 0)
    drawn = sys.stderr.isatty()

    def callback(done: int, total: int, message: str = "") -> None:
        nonlocal shown, logged, since, first, last
        now = time.monotonic()
        another = total != last[1] or done < last[0]
        if another:
            since, first = now, done
        last = done, total
        if not drawn:
            if now - logged > LOG_EVERY:
                logged = now
                left = f", {(now - since) * (total - done) / (done - first) / 60:.1f} min left" if done > first else ""
                print(f"{title}: {done / max(total, 1):.0%}{left} {message}", file=sys.stderr, flush=True)
            return
        if shown is None and now - began < QUIET_FOR:
            return
        if shown is None:
            bar.start()
            shown = bar.add_task(title, total=total, message="")
        elif another:
            bar.reset(shown, total=total)
        bar.update(shown, completed=done, total=total, message=message)

    try:
        yield callback
    finally:
        if shown is not None:
            bar.stop()
