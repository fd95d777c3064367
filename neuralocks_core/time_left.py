# SPDX-License-Identifier: Apache-2.0
"""The time left for long work, at its speed so far."""

import time


class TimeLeft:
    """An estimate from reports of how far the work is.

    A resumed job starts in the middle, steps follow each other, and some prepare for long before they start. So the speed is
    measured only on the current step, from its first progress on.

    Args:
        expected: total seconds of the work, if known; used until its speed is known.
        enough, after: share of the work, and seconds, after which its speed is known: the first part of some work takes as long as
            many others.
    """

    def __init__(self, expected: float | None = None, *, enough: float = 0.03, after: float = 2.0):
        self._expected, self._enough, self._after = expected, enough, after
        self._first = self._last = 0.0
        self._total, self._since, self._now = 1.0, None, 0.0

    def told(self, done: float, total: float = 1.0, now: float | None = None) -> None:
        """Report that `done` of `total` is done, at `now` on the clock of `time.monotonic`. Another total, or less done than
        before, means another step.
        """
        now = time.monotonic() if now is None else now
        if self._since is None or total != self._total or done < self._last or done == self._first:
            self._first, self._since = done, now
        self._last, self._total, self._now = done, total, now

    @property
    def seconds(self) -> float | None:
        """Seconds left at the last report; None while unknown."""
        gone = self._last - self._first
        if gone > self._enough * self._total and self._now - self._since >= self._after:
            return (self._now - self._since) * (self._total - self._last) / gone
        return None if self._expected is None else self._expected * (1 - self._last / self._total)
