# SPDX-License-Identifier: GPL-3.0-or-later
"""How the panel and the status line show the time left."""


def in_words(seconds: float | None) -> str:
    """The time with a comma before it, since it follows the share that is done; empty if it is not known."""
    if seconds is None:
        return ""
    return f", {max(1, round(seconds))} s left" if seconds < 59.5 else f", {round(seconds / 60)} min left"
