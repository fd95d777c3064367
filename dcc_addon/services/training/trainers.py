# SPDX-License-Identifier: GPL-3.0-or-later
"""Which Pythons can train, asked in the background, since an answer takes seconds."""

import threading
import time

from .training_job import problem

AGAIN = 10.0
"""This long after its answer [s], a Python that could not train is asked again: what it lacked may be there by then."""


class Trainers:
    """What is known of Pythons, by their path.

    Args:
        ask: returns why a Python cannot train, empty if it can; called in threads.
    """

    def __init__(self, ask=problem):
        self._ask = ask
        self._answers: dict[str, tuple[str, float]] = {}
        """Each answer with the time at which it came [s]."""
        self._asked: set[str] = set()

    @property
    def asking(self) -> bool:
        """Whether an answer is still to come."""
        return bool(self._asked)

    def known(self, python: str) -> str | None:
        """Why it cannot train, by the latest answer; empty if it can, None if the first one is still to come. Asks for a new one if
        that is due, and does not wait for it.
        """
        answer, when = self._answers.get(python, (None, 0.0))
        due = answer is None or (answer and time.monotonic() - when > AGAIN)
        if due and python not in self._asked:
            self._asked.add(python)
            threading.Thread(target=self.look, args=[python], daemon=True).start()
        return answer

    def look(self, python: str) -> str:
        """Why it cannot train, asked now."""
        try:
            answer = self._ask(python)
            self._answers[python] = answer, time.monotonic()
            return answer
        finally:
            self._asked.discard(python)
