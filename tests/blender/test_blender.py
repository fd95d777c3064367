# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on in real Blenders, each scenario in its own process with a time limit.

The oldest and the newest are tested by default; NEURALOCKS_BLENDERS=all (or a list, `4.5,5.0`) chooses others.
"""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from .. import blenders
from . import scenarios

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
VERSIONS = ("4.2", "4.5", "5.0", "5.2")
WINDOWED = "3.4"
LIMIT = 120
SLOW = {"trained_for_real": 900}
"""Scenarios that take longer [s]: run with NEURALOCKS_SLOW=1."""


def _wanted() -> list[str]:
    chosen = os.environ.get("NEURALOCKS_BLENDERS", "4.2,5.2")
    return [*VERSIONS, WINDOWED] if chosen == "all" else chosen.split(",")


def _command(version: str) -> list[str]:
    """How to run a script in this Blender; skips where it is not installed."""
    script = str(HERE / "run.py")
    if version == WINDOWED:
        if not shutil.which("blender"):
            pytest.skip("no blender program is installed")
        return ["blender", "-b", "--factory-startup", "--python-exit-code", "1", "--python", script, "--"]
    return [str(blenders.python_of(version)), script]


@pytest.mark.parametrize("scenario", scenarios.modules())
@pytest.mark.parametrize("version", _wanted())
def test_scenario(version, scenario, random_model, tmp_path):
    """Runs one scenario; its output is shown when it fails."""
    if scenario in SLOW and not os.environ.get("NEURALOCKS_SLOW"):
        pytest.skip("takes minutes; set NEURALOCKS_SLOW=1")
    limit = SLOW.get(scenario, LIMIT)
    command = _command(version)
    resources = tmp_path / "resources"
    resources.mkdir()
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "BLENDER"))}
    environment = kept | {
        "NEURALOCKS_TEST_MODEL": str(random_model),
        "OMP_NUM_THREADS": "1",
        "BLENDER_USER_RESOURCES": str(resources),
    }
    if version == WINDOWED:
        environment["PYTHONPATH"] = str(blenders.packages_of("4.2"))
    try:
        done = subprocess.run(
            [*command, scenario, str(tmp_path / "work")],
            env=environment,
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=limit,
        )
    except subprocess.TimeoutExpired:
        pytest.fail(f"{scenario} in Blender {version} did not end within {limit} s")
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-6000:]
