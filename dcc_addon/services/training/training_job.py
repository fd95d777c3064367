# SPDX-License-Identifier: GPL-3.0-or-later
"""Training in a separate process, in a Python that has torch; Blender stays usable and only reads its output."""

import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import neuralocks_core
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.time_left import TimeLeft
from neuralocks_core.training.work_folder import abandon

from .training_check import CAN
from .training_child import AROUND, LEARNED

CHILD = Path(__file__).with_name("training_child.py")
CHECK = Path(__file__).with_name("training_check.py")
ADDON = Path(__file__).resolve().parents[2]
_NEW_GROUP, _NO_WINDOW = 0x00000200, 0x08000000
"""Flags with which Windows starts a program that Ctrl-C in Blender's console does not reach, and that opens no console."""
ANSWER = 60
"""[s] Torch may take this long to load, the first time, from a slow drive."""
_KILLED = 9
"""The signal that a system short of memory sends."""
UTF8 = {"encoding": "utf-8", "errors": "replace"}
"""For a child's input and output. With a Windows code page, a letter that it lacks would end the reader."""


def problem(python: str) -> str:
    """Why this Python cannot train, with the remedy; empty if it can.

    Args:
        python: path of an interpreter; empty means none is set.
    """
    remedy = f"in a Python of your own run: {installing()}; then name that Python in the add-on's preferences"
    if not python:
        return f"Training needs a Python with torch, which is too large to come with the add-on; {remedy}"
    if not os.path.isfile(python):
        fact = "is a folder; choose the program in it" if os.path.isdir(python) else "no such file"
        return f"{python}: {fact}; {remedy}"
    try:
        done = subprocess.run(
            [python, str(CHECK)],
            env=environment(),
            capture_output=True,
            **UTF8,
            timeout=ANSWER,
            stdin=subprocess.DEVNULL,
            creationflags=_NO_WINDOW if os.name == "nt" else 0,
        )
    except subprocess.TimeoutExpired:
        return f"{python}: does not answer within {ANSWER} s; {remedy}"
    except OSError as error:
        return f"{python}: cannot be run ({error.strerror or type(error).__name__}); {remedy}"
    if done.returncode:
        lines = [line for line in done.stderr.strip().splitlines() if line]
        return f"{python}: {lines[-1] if lines else 'does not run'}; {remedy}"
    if CAN not in done.stdout.splitlines():
        return f"{python}: is not a Python; {remedy}"
    return ""


def installing() -> str:
    """The command that gives a Python what training needs: with the wheel beside the add-on or, in a source checkout, with the
    checkout. No package index has the project.
    """
    wheel = next((ADDON / "wheels").glob("neuralocks-*.whl"), None)
    python = "py" if os.name == "nt" else "python3"
    return f'{python} -m pip install "{wheel or ADDON.parent}[train]"'


def environment() -> dict[str, str]:
    """This process's environment without what belongs to Blender's own Python; the packages beside the add-on can be found. Numpy
    does not split small matrices among threads, which would wait for each other beside Blender's.
    """
    kept = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")} | {"PYTHONUTF8": "1"}
    kept.setdefault("OPENBLAS_NUM_THREADS", "1")
    root = Path(neuralocks_core.__file__).resolve().parent.parent
    # A source checkout serves the child too. A site-packages folder does not: its compiled packages are for Blender's
    # Python.
    if root.name not in ("site-packages", "packages"):
        kept["PYTHONPATH"] = str(root)
    return kept


class TrainingJob:
    """A running training.

    Attributes:
        done, message: progress from 0 to 1, and the latest line with the gauge.
        notes: what somebody should know of the character, and at the end of what was learned; each once.
        error: why it failed, in one line; empty otherwise.
        lines: as many as the panel has needed for a message so far.
        out: the model file that it writes.
    """

    def __init__(self, python: str, settings: dict):
        self.done, self.message, self.error, self.out = 0.0, "Starting", "", settings["out"]
        self.notes: list[str] = []
        self.lines = 1
        least = LEARNED + AROUND if settings.get("kind") == "rig" else 0.0
        self._before = TimeLeft()
        self._left = TimeLeft(max(least, 60 * settings["minutes"]))
        self._cancelled = False
        group = {"start_new_session": True} if os.name == "posix" else {"creationflags": _NEW_GROUP | _NO_WINDOW}
        try:
            self._process = subprocess.Popen(
                [python, str(CHILD)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env=environment(),
                **UTF8,
                **group,
            )
        except OSError as error:
            raise NeuralocksError(
                f"{python}: cannot be run ({error.strerror}); free some memory, and try again"
            ) from None
        with suppress(OSError), self._process.stdin as heard:  # a process that has ended already says why
            heard.write(json.dumps(settings))
        self._last = ""
        self._threads = [threading.Thread(target=f, daemon=True) for f in (self._listen, self._drain)]
        for thread in self._threads:
            thread.start()

    @property
    def running(self) -> bool:
        """Whether it still works."""
        return self._process.poll() is None or any(t.is_alive() for t in self._threads)

    @property
    def succeeded(self) -> bool:
        """Whether it ended well, and with a model."""
        ended = not self.running and not self._cancelled and self._process.returncode == 0
        return ended and os.path.isfile(self.out)

    @property
    def seconds_left(self) -> float:
        """Estimate from what is done so far; before anything is, from the time that it was given, and the work before it."""
        before = 0.0 if self.done else self._before.seconds or 0.0
        return before + self._left.seconds

    def cancel(self) -> None:
        """Stop it and the processes that it started, and leave nothing behind; the model of a training that ended well is kept."""
        self._cancelled = True
        for hard in (False, True):
            if self._process.poll() is None:
                with suppress(OSError, subprocess.TimeoutExpired):
                    self._end(hard)
                    self._process.wait(5)
        abandon(self.out)

    def _end(self, hard: bool) -> None:
        if os.name == "posix":
            os.killpg(self._process.pid, signal.SIGKILL if hard else signal.SIGTERM)
        else:  # `terminate` would leave its child processes running
            command = ["taskkill", "/T", "/F", "/PID", str(self._process.pid)]
            subprocess.run(
                command, stdin=subprocess.DEVNULL, capture_output=True, creationflags=_NO_WINDOW, check=False
            )

    def failure(self) -> str:
        """Why it failed, in one line."""
        if self.error or self._cancelled or self.running or self.succeeded:
            return self.error
        if self._process.returncode == 0:
            return f"it ended without {self.out}; try again"
        if self._process.returncode == -_KILLED:  # nothing that it said before tells why
            return "its process was killed; free some memory, and try again"
        return self._last or f"training ended with status {self._process.returncode}"

    def _listen(self) -> None:
        with self._process.stdout as lines:
            for line in lines:
                with suppress(ValueError, TypeError):  # a library's output, which may be JSON by chance
                    said = json.loads(line)
                    if isinstance(said, dict):
                        self._told(said)

    def _told(self, said: dict) -> None:
        if "error" in said:
            self.error = str(said["error"])
        elif "notes" in said:
            self.notes = list(dict.fromkeys([*self.notes, *map(str, said["notes"])]))
        elif "before" in said:
            self._before.told(float(said["before"]))
        else:
            self.done = float(said.get("done", self.done))
            self._left.told(self.done)
            self.message = str(said.get("message", self.message))

    def _drain(self) -> None:
        with self._process.stderr as lines:
            for line in lines:
                self._last = line.strip() or self._last


def default_python() -> str:
    """An interpreter that may have torch: that of an activated or nearby environment."""
    name = "Scripts/python.exe" if sys.platform == "win32" else "bin/python"
    folders = [os.environ.get("VIRTUAL_ENV"), Path(neuralocks_core.__file__).resolve().parent.parent / ".venv"]
    found = (Path(folder) / name for folder in folders if folder)
    return next((str(path) for path in found if path.is_file()), "")
