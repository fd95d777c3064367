# SPDX-License-Identifier: GPL-3.0-or-later
"""Training in a process of its own, as the panel starts and watches it."""

import ast
import importlib
import itertools
import os
import shutil
import sys
import time
from types import SimpleNamespace

import pytest

import neuralocks_core
from dcc_addon.services.training import training_check, training_job
from neuralocks_core import time_left
from neuralocks_core.errors import NeuralocksError

CHILD = """
import json, os, sys, time
settings = json.load(sys.stdin)
mode = os.path.basename(settings["out"])
print(json.dumps({"done": 0.5, "message": "half"}), flush=True)
for told in (["/Hair: a", "b"], ["b", "K\xfcche"]): print(json.dumps({"notes": told}), flush=True)
if mode == "wait": time.sleep(60)
if mode == "number": print(5); print("null"); print(json.dumps({"done": 0.75, "message": "more"}))
if mode == "killed": print("a warning", file=sys.stderr, flush=True); os.kill(os.getpid(), 9)
if mode == "early":
    print(json.dumps({"done": 0, "message": "first"}), flush=True)
    while not os.path.exists(settings["out"] + ".go"): time.sleep(0.01)
    for before in (0.0, 0.5): print(json.dumps({"before": before}), flush=True)
    time.sleep(60)
if mode == "fail":
    print(json.dumps({"error": "/Hair: no hair; add some"}), flush=True); sys.exit(1)
if mode == "odd":
    for stream in (sys.stdout, sys.stderr): stream.buffer.write(b"\\xff\\x81\\n7\\n[1]\\n"); stream.flush()
    for said in ({"done": "soon"}, {"done": None}, {"before": [1]}, {"notes": 3}): print(json.dumps(said), flush=True)
    print(json.dumps({"done": 0.75}), flush=True); sys.exit("broken: K\xfcche")
if mode == "crash": raise RuntimeError("boom")
if mode != "none": open(settings["out"], "w").close()
"""


@pytest.fixture
def job(tmp_path, monkeypatch):
    child = tmp_path / "child.py"
    child.write_text(CHILD, encoding="utf-8")
    monkeypatch.setattr(training_job, "CHILD", child)
    started = []

    def start(out):
        started.append(training_job.TrainingJob(sys.executable, {"out": str(tmp_path / out), "minutes": 15}))
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
    running = job("number")  # a library's own output
    _wait(lambda: not running.running)
    assert running.succeeded and running.message == "more"


def test_what_comes_before_the_training_counts_too(job, monkeypatch, tmp_path):
    reports = itertools.count(step=8.0)  # eight seconds between any two
    monkeypatch.setattr(time_left, "time", SimpleNamespace(monotonic=lambda: next(reports)))
    running = job("early")
    _wait(lambda: running.message == "first")
    assert running.seconds_left == 900
    (tmp_path / "early.go").touch()
    _wait(lambda: running.seconds_left > 900)
    assert running.seconds_left == 908


def test_training_is_cancelled_at_once(job):
    running = job("wait")
    _wait(lambda: running.done == 0.5)
    assert running.running and 0 < running.seconds_left <= 450
    running.cancel()
    _wait(lambda: not running.running)
    assert not running.succeeded


def test_what_a_cancelled_training_has_made_goes_with_it(job, tmp_path):
    """Nothing resumes from it, and it may be gigabytes beside the artist's file."""
    running = job("wait")
    _wait(lambda: running.done == 0.5)
    made = tmp_path / "wait.training" / "rollouts"
    made.mkdir(parents=True)
    (made / "000000.npz").touch()
    running.cancel()
    assert not made.parent.exists()


def test_one_that_ends_before_it_has_heard_what_to_do_is_told_of(monkeypatch, tmp_path):
    child = tmp_path / "child.py"
    child.write_text("import os, sys; os.close(0); print('broken', file=sys.stderr, flush=True); os._exit(3)")
    monkeypatch.setattr(training_job, "CHILD", child)
    long = {"out": "x", "minutes": 1, "chains": ["*" * 1_000_000]}  # more than a pipe holds until it is read
    running = training_job.TrainingJob(sys.executable, long)
    _wait(lambda: not running.running)
    assert running.failure() == "broken"
    with pytest.raises(NeuralocksError, match="cannot be run"):
        training_job.TrainingJob(str(tmp_path), {"out": "x", "minutes": 1})


def test_time_left_is_known_before_anything_is_learned(job, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(time_left.time, "monotonic", lambda: clock[0])
    left = time_left.TimeLeft(900)
    said = []
    for now, done in [(0, 0.0), (60, 0.0), (65, 0.0), (74, 0.01), (110, 0.05), (515, 0.5)]:
        clock[0] = now
        left.told(done)
        said.append(left.seconds)
    assert said[:3] == [900, 900, 900], "the first simulations are no speed"
    assert said[3:] == pytest.approx([891, 855, 450])


@pytest.mark.parametrize(
    ("out", "words"),
    [("fail", "/Hair: no hair; add some"), ("crash", "RuntimeError: boom"), ("odd", "broken: K\xfcche")]
    + [("none", "without {out}; try again")]
    + [("killed", "its process was killed; free some memory, and try again")] * (os.name == "posix"),
)
def test_training_says_why_it_failed(job, out, words):
    running = job(out)
    _wait(lambda: not running.running)
    assert not running.succeeded and running.failure().endswith(words.format(out=running.out))
    assert running.done == (0.75 if out == "odd" else 0.5), (
        "bytes that are no text, or JSON of others, end nobody who listens"
    )


_PROBLEMS = [
    ("", "needs a Python with torch"),
    ("/nowhere/python", "no such file"),
    (os.path.sep, "is a folder; choose"),
]


@pytest.mark.skipif(os.name != "posix", reason="of a program that only there comes with the system")
def test_a_program_that_is_no_python_cannot_train():
    assert f"{shutil.which('true')}: is not a Python; in a Python of" in training_job.problem(shutil.which("true"))


def test_why_a_python_cannot_be_asked(tmp_path, monkeypatch):
    """In words, not as names of errors."""
    check = tmp_path / "check.py"
    check.write_text("import time; time.sleep(60)")
    monkeypatch.setattr(training_job, "CHECK", check)
    monkeypatch.setattr(training_job, "ANSWER", 0.2)
    assert f"{sys.executable}: does not answer within 0.2 s; in a Python of" in training_job.problem(sys.executable)
    if os.name == "posix":
        assert f"{check}: cannot be run (Permission denied); in a" in training_job.problem(str(check))


def test_a_python_that_can_train_says_so(tmp_path, monkeypatch):
    """Whatever libraries print while they load."""
    modules = ("torch", "warp", "onnx", "usd", "usd.models", "usd.models.train")
    check = tmp_path / "check.py"
    given = f"import sys; sys.modules.update(dict.fromkeys({modules!r}, sys)); print('loading')\n"
    check.write_text(given + training_job.CHECK.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.setattr(training_job, "CHECK", check)
    assert training_job.problem(sys.executable) == ""


def test_what_is_too_old_can_read_that_it_is():
    """Python 2.7 has no f-strings or annotations, takes only ASCII, and would report a syntax error."""
    source = training_job.CHECK.read_bytes().decode("ascii")
    for node in ast.walk(ast.parse(source)):
        assert not isinstance(node, (ast.JoinedStr, ast.AnnAssign, ast.NamedExpr, ast.AsyncFunctionDef, ast.Nonlocal))
        assert not (isinstance(node, ast.arg) and node.annotation or isinstance(node, ast.FunctionDef) and node.returns)
        assert not (isinstance(node, ast.arguments) and (node.kwonlyargs or node.posonlyargs))
        assert not (isinstance(node, ast.Raise) and node.cause)


def test_a_child_has_the_environment_of_a_terminal(monkeypatch, tmp_path):
    """What belongs to Blender's Python would break another; packages for Blender's Python are not for it, a checkout is."""
    for name in ("PYTHONHOME", "PYTHONPATH", "PYTHONNOUSERSITE"):
        monkeypatch.setenv(name, "blender")
    monkeypatch.setenv("MINE", "kept")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    child = training_job.environment()
    assert {name for name in child if name.startswith("PYTHON")} == {"PYTHONPATH", "PYTHONUTF8"}
    assert child["PYTHONPATH"] == str(training_job.ADDON.parent) and child["MINE"] == "kept"
    assert child["OPENBLAS_NUM_THREADS"] == "1"
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    monkeypatch.setattr(
        neuralocks_core, "__file__", str(tmp_path / "site-packages" / "neuralocks_core" / "__init__.py")
    )
    child = training_job.environment()
    assert "PYTHONPATH" not in child and child["OPENBLAS_NUM_THREADS"] == "3"


@pytest.mark.parametrize(("python", "words"), _PROBLEMS)
def test_missing_trainer_comes_with_a_remedy(python, words):
    problem = training_job.problem(python)
    assert words in problem and f'pip install "{training_job.ADDON.parent}[train]"' in problem


def test_the_remedy_names_the_wheel_that_comes_along(tmp_path, monkeypatch):
    wheel = tmp_path / "wheels" / "neuralocks-1.0-py3-none-any.whl"
    wheel.parent.mkdir()
    wheel.touch()
    monkeypatch.setattr(training_job, "ADDON", tmp_path)
    assert f'pip install "{wheel}[train]"' in training_job.problem("")


def test_why_a_python_cannot_train(tmp_path, monkeypatch):
    """A version is too old, a package is missing, or is there and does not load."""
    monkeypatch.syspath_prepend(tmp_path)
    for package in ("torch", "warp"):
        monkeypatch.delitem(sys.modules, package, raising=False)
    torch = tmp_path / "torch.py"
    torch.write_text("raise ImportError('libcudart.so.12: cannot open\\nshared object file')")
    assert training_check.lacking() == "its 'torch' does not load (libcudart.so.12: cannot open shared object file)"
    torch.write_text("import of_torch")
    importlib.invalidate_caches()
    assert training_check.lacking() == "it lacks 'of_torch'"
    monkeypatch.setattr(training_check.sys, "version_info", (3, 9, 18))
    assert training_check.lacking().endswith("and 3.11 or newer is needed")
