# SPDX-License-Identifier: GPL-3.0-or-later
"""Training in a process of its own, as the panel starts and watches it."""

import sys
import time

import pytest

from dcc_addon.services import training_job

CHILD = """
import json, sys, time
settings = json.load(sys.stdin)
print(json.dumps({"done": 0.5, "message": "half"}), flush=True)
for told in (["/Hair: a", "b"], ["b", "K\xfcche"]): print(json.dumps({"notes": told}), flush=True)
if settings["out"] == "wait": time.sleep(60)
if settings["out"] == "fail":
    print(json.dumps({"error": "/Hair: no hair; add some"}), flush=True); sys.exit(1)
if settings["out"] == "odd":
    for stream in (sys.stdout, sys.stderr): stream.buffer.write(b"\\xff\\x81\\n7\\n[1]\\n"); stream.flush()
    print(json.dumps({"done": 0.75}), flush=True); sys.exit("broken: K\xfcche")
if settings["out"] == "crash": raise RuntimeError("boom")
"""


@pytest.fixture
def job(tmp_path, monkeypatch):
    child = tmp_path / "child.py"
    child.write_text(CHILD, encoding="utf-8")
    monkeypatch.setattr(training_job, "CHILD", child)
    started = []

    def start(out):
        started.append(training_job.TrainingJob(sys.executable, {"out": out}))
        return started[-1]

    yield start
    for one in started:
        one.cancel()


def _wait(condition):
    end = time.monotonic() + 30
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    assert condition()


def test_training_runs_beside_and_says_how_far_it_is(job):
    running = job("well")
    _wait(lambda: not running.running)
    assert running.succeeded and running.message == "half" and running.done == 0.5
    assert running.notes == ["/Hair: a", "b", "K\xfcche"]


def test_training_is_cancelled_at_once(job):
    running = job("wait")
    _wait(lambda: running.done == 0.5)
    assert running.running and running.seconds_left is not None
    running.cancel()
    _wait(lambda: not running.running)
    assert not running.succeeded


@pytest.mark.parametrize(
    ("out", "words"),
    [("fail", "/Hair: no hair; add some"), ("crash", "RuntimeError: boom"), ("odd", "broken: K\xfcche")],
)
def test_training_says_why_it_failed(job, out, words):
    running = job(out)
    _wait(lambda: not running.running)
    assert not running.succeeded and running.failure() == words
    assert running.done == (0.75 if out == "odd" else 0.5), (
        "bytes that are no text, or JSON of others, end nobody who listens"
    )


@pytest.mark.parametrize(("python", "words"), [("", "needs a Python with torch"), ("/nowhere/python", "no such file")])
def test_missing_trainer_comes_with_a_remedy(python, words):
    problem = training_job.problem(python)
    assert words in problem and f'pip install "{training_job.ADDON.parent}[train]"' in problem


def test_the_remedy_names_the_wheel_that_comes_along(tmp_path, monkeypatch):
    wheel = tmp_path / "wheels" / "neuralocks-1.0-py3-none-any.whl"
    wheel.parent.mkdir()
    wheel.touch()
    monkeypatch.setattr(training_job, "ADDON", tmp_path)
    assert f'pip install "{wheel}[train]"' in training_job.problem("")
