# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C in the middle of what takes it for something else."""

import os
import signal
import subprocess
import sys
from contextlib import suppress

import pytest
import typer

from usd.__main__ import main
from usd.border.stage_files import write_stage
from usd.border.stopping import INTERRUPTED, deferred, stoppable
from usd.cli import app as cli
from usd.cli.command import command_of
from usd.cli.progress import progress_bar


@pytest.fixture(autouse=True)
def _heard():
    """The tests may have been started deaf to Ctrl-C, as a shell's background jobs are."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _press() -> None:
    """Press Ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)


def _swallowed() -> None:
    """As USD does while it loads its modules; work then goes on to its next step."""
    try:
        _press()
    except KeyboardInterrupt:
        pass
    with progress_bar("baking") as say:
        say(0, 1, "reading")
    raise AssertionError("it went on")


def _turned_into_another() -> None:
    """As compiled modules do that call Python and do not check for errors."""
    try:
        _press()
    except KeyboardInterrupt as error:
        raise SystemError("returned a result with an exception set") from error


@pytest.mark.parametrize("work", [_press, _swallowed, _turned_into_another])
def test_ctrl_c_ends_a_command_whatever_it_meets(work, capsys):
    app = typer.Typer()
    command_of(app)("work")(work)
    with pytest.raises(SystemExit) as caught:
        app([])
    assert caught.value.code == INTERRUPTED
    assert capsys.readouterr().err == "stopped\n"
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_farm_or_a_closed_terminal_ends_a_command_as_ctrl_c_does(name, capsys):
    """So it has time to take away what is half written."""
    number = getattr(signal, name, None)
    if number is None:
        pytest.skip(f"{name} is of Unix")
    app = typer.Typer()

    def work():
        """As a scheduler does that needs the machine."""
        os.kill(os.getpid(), number)

    command_of(app)("work")(work)
    before = signal.signal(number, signal.SIG_DFL)
    try:
        with pytest.raises(SystemExit) as caught:
            app([])
        assert (caught.value.code, capsys.readouterr().err) == (128 + number, "stopped\n")
        assert signal.getsignal(number) == signal.SIG_DFL
    finally:
        signal.signal(number, before)


@pytest.mark.skipif(os.name == "nt", reason="nohup is of Unix")
def test_a_job_that_outlives_its_terminal_stays_deaf_to_that(capsys):
    def work():
        """As under nohup."""
        os.kill(os.getpid(), signal.SIGHUP)
        print("done")

    app = typer.Typer()
    command_of(app)("work")(work)
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with pytest.raises(SystemExit) as caught:
            app([])
        assert (caught.value.code, capsys.readouterr().out) == (0, "done\n")
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_terminal_that_is_gone_is_told_nothing(monkeypatch):
    class Gone:
        def write(self, text):
            raise OSError("Input/output error")

    monkeypatch.setattr(sys, "stderr", Gone())
    with pytest.raises(SystemExit) as caught, stoppable():
        _press()
    assert caught.value.code == INTERRUPTED


def test_ctrl_c_waits_while_modules_load(capsys):
    """Interrupting their loading leaves them half loaded, and what is loaded next may crash."""
    loaded = []

    def work():
        """As a drawing command does."""
        with deferred():
            _press()
            loaded.append("whole")
        raise AssertionError("it went on")

    app = typer.Typer()
    command_of(app)("work")(work)
    with pytest.raises(SystemExit) as caught:
        app([])
    assert (caught.value.code, capsys.readouterr().err, loaded) == (INTERRUPTED, "stopped\n", ["whole"])


def test_ctrl_c_that_was_swallowed_puts_no_file_under_its_name(tmp_path, capsys):
    def author(stage):
        stage.DefinePrim("/Hero")
        with suppress(KeyboardInterrupt):
            _press()

    with pytest.raises(SystemExit), stoppable():
        write_stage(tmp_path / "a.usda", author)
    assert not list(tmp_path.iterdir()) and capsys.readouterr().err == "stopped\n"


def test_ctrl_c_while_the_command_line_is_read_is_one_word(monkeypatch, capsys):
    monkeypatch.setattr(cli, "app", lambda words: _press())
    with pytest.raises(SystemExit) as caught:
        main()
    assert (caught.value.code, capsys.readouterr().err) == (INTERRUPTED, "stopped\n")


@pytest.mark.parametrize("press", ["{}", "exec('{}')"])
@pytest.mark.parametrize("module", ["usd.cli.app", "pxr.Gf"])
def test_ctrl_c_is_one_word_from_the_beginning(module, press, tmp_path):
    """While the command line is loaded, and while USD is; also within code in a string, as dataclasses are made, after which
    Python would end as if killed.
    """
    code = """import importlib.abc, os, signal, sys
class Pressed(importlib.abc.MetaPathFinder):
    def find_spec(self, name, *_):
        if name == sys.argv[0]:
            PRESS
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Pressed())
from usd.__main__ import main
sys.argv = sys.argv[1:]
main()""".replace("PRESS", press.format("os.kill(os.getpid(), signal.SIGINT)"))
    (tmp_path / "pressed.py").write_text(code)
    words = ["-m", "pressed", module, "inspect", str(tmp_path / "none.usda")]
    there = {**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path, str(tmp_path)])}
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True, env=there)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "stopped\n")


@pytest.mark.skipif(os.name == "nt", reason="no signal reaches one process alone")
def test_ctrl_c_pressed_again_tells_no_traceback():
    """Threads that still compute are waited for after the command, by Python itself."""
    code = """import os, signal, sys, threading, time
main_thread = threading.main_thread().ident
def press():
    while sys._current_frames()[main_thread].f_code is not threading._shutdown.__code__:
        time.sleep(0.01)
    os.kill(os.getpid(), signal.SIGINT)
signal.signal(signal.SIGINT, signal.default_int_handler)
from usd.__main__ import main
from usd.cli import app
def stop(words):
    threading.Thread(target=press).start()
    raise KeyboardInterrupt
app.app = stop
main()"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "stopped\n")
