# SPDX-License-Identifier: GPL-3.0-or-later
"""How long work still takes, at its speed so far."""

import time

KNOWN, ENOUGH = 2.0, 0.03
"""Seconds, and share of the work, after which its speed is known: the first step of some takes as long as many others."""


class Remaining:
    """An estimate that is told how far the work is.

    Args:
        expected: seconds that it takes in all, if somebody knows; they count until its speed is known.
    """

    def __init__(self, expected: float | None = None):
        self._expected = expected
        self._first = self._last = 0.0
        self._since = time.monotonic()

    def told(self, done: float) -> None:
        """It is so far, from 0 to 1. What was waited for before it got going does not tell its speed, nor does an earlier part
        of it that counted by itself.
        """
        if done < self._last or done == self._first:
            self._first, self._since = done, time.monotonic()
        self._last = done

    @property
    def seconds(self) -> float | None:
        """Seconds left; None as long as nobody knows."""
        gone, spent = self._last - self._first, time.monotonic() - self._since
        if gone >= ENOUGH and spent >= KNOWN:
            return spent * (1 - self._last) / gone
        return None if self._expected is None else self._expected * (1 - self._last)


def in_words(seconds: float | None) -> str:
    """With a comma before it, as it follows the share that is done; empty where it is not known."""
    if seconds is None:
        return ""
    return f", {max(1, round(seconds))} s left" if seconds < 59.5 else f", {round(seconds / 60)} min left"
