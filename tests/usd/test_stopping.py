# SPDX-License-Identifier: Apache-2.0
"""Ctrl-C in the middle of what takes it for something else."""

import os
import signal
import subprocess
import sys

import pytest
import typer

from usd.command import INTERRUPTED, command_of
from usd.progress import progress_bar


@pytest.fixture(autouse=True)
def _heard():
    """Whatever started the tests may have them deaf to Ctrl-C, as a shell's background jobs are."""
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
    """As compiled modules do that call Python and forget to ask how it went."""
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


def test_ctrl_c_while_the_command_line_is_read_is_one_word():
    code = """import sys
class Pressed:
    def find_spec(self, name, *_):
        if name == "usd.cli":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Pressed())
from usd.__main__ import main
main()"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "stopped\n")
