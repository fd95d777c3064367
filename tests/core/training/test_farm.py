# SPDX-License-Identifier: Apache-2.0
"""Processes that simulate while a network trains."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("warp", reason="the extra 'train' is not installed")

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models.network_sizes import K
from neuralocks_core.training import checkpoint
from neuralocks_core.training.data import farm
from neuralocks_core.training.data.rollouts import FINEST, Rollout
from neuralocks_core.training.learning import methods


def farm_of(monkeypatch, folder, *processes):
    """A farm with stand-ins for its processes."""
    each = iter(processes)
    context = SimpleNamespace(Pipe=multiprocessing.Pipe, Process=lambda **_: next(each))
    monkeypatch.setattr(multiprocessing, "get_context", lambda method: context)
    return farm.RolloutFarm(None, folder, 2, len(processes))


class _Process:
    """Stands in for a process of a farm."""

    pid = None

    def __init__(self, starts=True):
        self.starts, self.ended = starts, False

    def start(self):
        assert os.environ["OMP_NUM_THREADS"] == "1"
        if not self.starts:
            raise OSError("no memory")
        self.pid = 1

    def terminate(self):
        assert self.pid
        self.ended = True

    def join(self):
        assert self.ended


def test_one_that_cannot_start_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    first = _Process()
    with pytest.raises(OSError, match="no memory"), farm_of(monkeypatch, tmp_path, first, _Process(starts=False)):
        pass
    assert first.ended
    assert "OMP_NUM_THREADS" not in os.environ and os.environ["OPENBLAS_NUM_THREADS"] == "3"


class _Farm:
    """Stands in for a farm whose process saves its last rollout and ends right after it has been counted."""

    alive = True
    there = 0

    def files(self, first=None):
        counted = [None] * self.there
        self.alive, self.there = False, 1
        return counted

    def failed(self):
        return False


def test_the_last_rollout_is_waited_for_though_its_process_has_ended():
    methods.wait(_Farm(), 1, lambda there, count: None)


def test_who_waits_is_told_how_many_there_are_and_what_ends_the_waiting(monkeypatch):
    """All there are, or those with the first numbers, which come in any order."""
    monkeypatch.setattr(methods, "LOOK_AGAIN", 0.0)
    made, said, error = [2, 0, 3, 1], [], NeuralocksError("farm: no memory")
    looks = iter(range(5))

    def files(first=None):
        return [number for number in made[: next(looks)] if first is None or number < first]

    slow = SimpleNamespace(files=files, alive=True, failed=lambda: False, failure=lambda: error)
    methods.wait(slow, 2, lambda *numbers: said.append(numbers))
    assert said == [(0, 2), (1, 2)]
    said.clear()
    looks = iter(range(5))
    methods.wait(slow, 2, lambda *numbers: said.append(numbers), numbered=True)
    assert said == [(0, 2), (0, 2), (1, 2), (1, 2)]
    for alive, failed in ((True, True), (False, False)):
        looks = iter(range(5))
        slow.alive, slow.failed = alive, lambda failed=failed: failed
        with pytest.raises(NeuralocksError, match="no memory"):
            methods.wait(slow, 2, lambda *numbers: pytest.fail("it is told of a farm that has ended"))


@pytest.mark.parametrize("kept", [0, 10, 1000])
def test_a_damaged_file_says_what_to_do(tmp_path, kept):
    """A full disk or a power cut cuts files short; a training that is resumed reads them again."""
    path = tmp_path / "000000.npz"
    np.savez(path, vectors=np.zeros((100, 8)))
    with pytest.raises(NeuralocksError, match="000000.npz: .* delete it"):
        farm.load(path)
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(NeuralocksError, match="000000.npz: .* delete it, and go on with --resume"):
        farm.load(path)
    with pytest.raises(NeuralocksError, match="000000.npz: .* train without --resume"):
        checkpoint.load(path, {})


def _rollout() -> Rollout:
    numbers = np.random.default_rng(0)
    planes, moved = numbers.normal(size=(5, 3, K, 4)).astype(np.float16), np.zeros((5, 3, K, 3), np.int16)
    rest, vectors = np.zeros((3, K, 3), np.float32), np.zeros((5, 8), np.float32)
    materials = np.zeros((3, 4), np.float32)
    return Rollout(0, np.arange(3), rest, 1, vectors, vectors[0], moved, 2 * FINEST, planes, 0.1, materials)


_OF = SimpleNamespace(grooms=(SimpleNamespace(rest=np.zeros((3, K, 3))),), spec=SimpleNamespace(size=8))


@pytest.mark.parametrize(
    "other",
    (
        {"rest": np.zeros((3, 2, 3), np.float32)},
        {"strands": np.arange(3.0)},
        {"strands": np.arange(3) - 1},
        {"strands": np.arange(3) + 1},
        {"groom": 1},
        {"groom": -1},
        {"first": 5},
        {"step": float("nan")},
        {"step": -1e-4},
        {"vectors": np.zeros((5, 9), np.float32), "bind": np.zeros(9, np.float32)},
        {"materials": np.zeros((3, 4), np.int16)},
    ),
)
def test_a_simulation_of_something_else_says_what_to_do(tmp_path, other):
    """Arrays that are whole, but do not fit each other or what is trained: without a check, training would break off."""
    path = tmp_path / "000000.npz"
    farm.save(path, _rollout())
    assert np.array_equal(farm.load(path, _OF).planes, _rollout().planes)
    assert farm.load(path, _OF).step == 2 * FINEST
    farm.save(path, replace(_rollout(), **other))
    with pytest.raises(NeuralocksError, match="000000.npz: this simulation cannot be read; delete it"):
        farm.load(path, _OF)


@pytest.mark.parametrize("most", [32766, 32767])
def test_a_simulation_that_names_no_step_is_gone_on_from_where_nothing_is_cut_off(tmp_path, most):
    """From a training that began before steps were stored: otherwise the remedy would be to delete hundreds of files."""
    path, arrays = tmp_path / "000000.npz", vars(replace(_rollout(), moved=np.full((5, 3, K, 3), -most, np.int16)))
    np.savez(path, **{name: array for name, array in arrays.items() if name != "step"})
    if most < 32767:
        assert farm.load(path, _OF).step == FINEST
    else:
        with pytest.raises(NeuralocksError, match="000000.npz: this simulation cannot be read; delete it"):
            farm.load(path, _OF)


class _Scene:
    """Stands in for a scene that the solver refuses; it knows whether Ctrl-C was heard where it arrived."""

    def __init__(self):
        self.deaf = sys.platform != "win32" and signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])

    def __getattr__(self, name):
        raise NeuralocksError(f"warp: is not installed; install it (deaf: {self.deaf})")

    def __reduce__(self):
        return (_Scene, ())


def test_a_process_that_fails_says_why_and_leaves_ctrl_c_to_the_trainer(tmp_path, capfd):
    """A terminal sends it to all; a simulation that hears it would end in a traceback beside the trainer's `stopped`."""
    before = signal.getsignal(signal.SIGINT)
    with farm.RolloutFarm(_Scene(), tmp_path, 1) as workers:
        assert signal.getsignal(signal.SIGINT) is before
        while workers.alive:
            time.sleep(0.01)
        assert workers.failed()
        deaf = sys.platform != "win32"  # there each process says so itself, once it has its scene
        said = f"warp: is not installed; install it (deaf: {deaf}), and go on with --resume"
        assert str(workers.failure()) == said
    assert capfd.readouterr().err == ""


UNGUARDED = """
import sys, time
from neuralocks_core.training.data.farm import RolloutFarm
from neuralocks_core.training.train import train_strands

if __name__ != "__main__":
    train_strands(None, sys.argv[1] + "/hair.neuralocks")
with RolloutFarm(bytes(1_000_000), sys.argv[1], 1) as workers:
    while workers.alive:
        time.sleep(0.01)
    print(workers.failure())
"""


def test_a_script_without_a_guard_is_told_and_does_not_hang(tmp_path):
    """Its processes import it, train again and end, before they have read a scene that is larger than a pipe."""
    pytest.importorskip("torch", reason="the extra 'train' is not installed")
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED, "utf-8")
    found = os.environ | {"PYTHONPATH": str(Path(farm.__file__).parents[3])}
    done = subprocess.run(
        [sys.executable, script, tmp_path], capture_output=True, text=True, env=found, timeout=100, check=True
    )
    assert 'call it under if __name__ == "__main__":' in done.stderr
    assert "ended early; fix what it reports above" in done.stdout


@pytest.fixture
def hears():
    """A Python that hears Ctrl-C, also where a shell runs the tests in the background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("hears")
def test_ctrl_c_while_processes_start_is_heard_once_they_run(tmp_path, monkeypatch):
    """Starting them takes seconds, in which a terminal's Ctrl-C could be lost."""
    started = []

    class Process:
        pid = None

        def __init__(self, **_):
            pass

        def start(self):
            signal.raise_signal(signal.SIGINT)
            started.append(self)

    monkeypatch.setattr(farm.multiprocessing.get_context("spawn"), "Process", Process)
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), farm.RolloutFarm(_Scene(), tmp_path, 2, processes=2):
        raise AssertionError("it was not heard")
    assert len(started) == 2 and signal.getsignal(signal.SIGINT) is before
    assert sys.platform == "win32" or not signal.pthread_sigmask(signal.SIG_BLOCK, [])


@pytest.mark.parametrize(
    ("status", "why"), [(-9, "was killed; free some memory, and"), (1, "fix what it reports above, and")]
)
def test_memory_is_blamed_for_a_process_that_was_killed(tmp_path, monkeypatch, status, why):
    assert why in str(farm_of(monkeypatch, tmp_path, SimpleNamespace(exitcode=status)).failure())
