# SPDX-License-Identifier: Apache-2.0
"""Processes that simulate while a network trains."""

import signal
import subprocess
import sys

import pytest

pytest.importorskip("warp", reason="the extra 'train' is not installed")

from neuralocks_core.training import farm

ASK = [sys.executable, "-c", "import signal; print(signal.getsignal(signal.SIGINT) == signal.SIG_IGN)"]


@pytest.mark.skipif(sys.platform == "win32", reason="there each process says so itself")
def test_ctrl_c_reaches_the_trainer_alone():
    """A terminal sends it to all; each simulation ended in a traceback beside the trainer's `stopped`."""
    before = signal.getsignal(signal.SIGINT)
    with farm._deaf_to_interrupts():
        inside = subprocess.run(ASK, capture_output=True, text=True, check=True).stdout.strip()
    assert inside == "True" and signal.getsignal(signal.SIGINT) is before
