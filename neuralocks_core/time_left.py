# SPDX-License-Identifier: Apache-2.0
"""The time left for long work, at its speed so far."""

import time


class TimeLeft:
    """An estimate that is told how far the work is.

    A resumed job begins in the middle, one step follows another, and some prepare long before they begin: only what is done of
    a step, since it got going, tells its speed.

    Args:
        expected: seconds that the work takes in all, if somebody knows; they count until its speed is known.
        enough, after: share of the work, and seconds, after which its speed is known: the first part of some takes as long as
            many others.
    """

    def __init__(self, expected: float | None = None, *, enough: float = 0.03, after: float = 2.0):
        self._expected, self._enough, self._after = expected, enough, after
        self._first = self._last = 0.0
        self._total, self._since, self._now = 1.0, None, 0.0

    def told(self, done: float, total: float = 1.0, now: float | None = None) -> None:
        """So much of `total` is done, `now` on the clock of `time.monotonic`. Another total, or less done than before, is of
        another step.
        """
        now = time.monotonic() if now is None else now
        if self._since is None or total != self._total or done < self._last or done == self._first:
            self._first, self._since = done, now
        self._last, self._total, self._now = done, total, now

    @property
    def seconds(self) -> float | None:
        """Seconds left when it was told last; None as long as nobody knows."""
        gone = self._last - self._first
        if gone > self._enough * self._total and self._now - self._since >= self._after:
            return (self._now - self._since) * (self._total - self._last) / gone
        return None if self._expected is None else self._expected * (1 - self._last / self._total)
