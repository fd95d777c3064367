# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in a real window under a virtual screen: a script clicks the tab, Live and Train, scrubs, bakes, takes a picture."""

import contextlib
import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

from .. import blenders

ROOT = Path(__file__).resolve().parents[2]


def test_panel_in_a_window(random_model, tmp_path):
    """Live and a training by clicks of the mouse, hair that follows the time line, a bake from the panel, a picture. What trains is a
    stand-in that copies a model.
    """
    for program in ("blender", "xvfb-run", "xdotool"):
        if not shutil.which(program):
            pytest.skip(f"{program} is not installed")
    packages = blenders.packages_of("4.2")  # The window's Blender runs the same Python 3.11.
    window = [
        "blender",
        "--factory-startup",
        "-p",
        "0",
        "0",
        "800",
        "640",
        "--python",
        str(Path(__file__).with_name("window.py")),
    ]
    command = ["xvfb-run", "-a", "-s", "-screen 0 800x640x24", *window, "--", str(tmp_path)]
    environment = os.environ | {
        "PYTHONPATH": str(packages),
        "NEURALOCKS_TEST_MODEL": str(random_model),
        "OMP_NUM_THREADS": "1",
    }
    running = subprocess.Popen(
        command, env=environment, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True,
    )  # fmt: skip
    try:
        said, _ = running.communicate(timeout=240)
    finally:  # the window and its screen are children of a shell, and would outlive it
        with contextlib.suppress(ProcessLookupError):
            os.killpg(running.pid, signal.SIGKILL)
    assert "all steps done" in said, said[-6000:]
    assert (tmp_path / "panel.png").stat().st_size > 20_000
    assert (tmp_path / "bake.usdc").stat().st_size > 10_000
