# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of a Python that trains follows what is done to it."""

import time

from dcc_addon.services.training import trainers


def _answered(asked: trainers.Trainers, python: str = "python") -> str | None:
    end = time.monotonic() + 30
    while asked.asking and time.monotonic() < end:
        time.sleep(0.005)
    return asked.known(python)


def test_a_problem_is_asked_about_again_some_seconds_later(monkeypatch):
    """Until then the last answer stands; a Python that can train is not asked again."""
    answers = ["it lacks torch", "it lacks warp", ""]
    asked = trainers.Trainers(lambda _: answers.pop(0))
    assert asked.known("python") is None
    assert _answered(asked) == "it lacks torch" and not asked.asking
    monkeypatch.setattr(trainers, "AGAIN", 0.0)
    assert asked.known("python") == "it lacks torch"
    monkeypatch.setattr(trainers, "AGAIN", 60.0)
    assert _answered(asked) == "it lacks warp" and not asked.asking
    monkeypatch.setattr(trainers, "AGAIN", 0.0)
    asked.known("python")
    assert _answered(asked) == "" and not asked.asking and not answers


def test_an_answer_that_was_waited_for_is_known():
    asked = trainers.Trainers(lambda python: f"{python} lacks torch")
    assert asked.look("one") == "one lacks torch" == asked.known("one") and not asked.asking
