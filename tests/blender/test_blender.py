# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on in real Blenders: one process for each, in which scenario follows scenario with a time limit, as an artist
opens file after file; after one that fails comes a fresh process.

The oldest and the newest are tested by default, and skipped where they are not installed; NEURALOCKS_BLENDERS=all (or a list,
`4.5,5.0`) chooses others, and then it is an error if one is not.
"""

import contextlib
import os
import subprocess
import time
from pathlib import Path

import pytest

from .. import blenders
from . import scenarios

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
LIMIT = 120
SLOW = {"trained_for_real": 900}
"""Scenarios that take longer [s]: run with NEURALOCKS_SLOW=1."""


def _command(version: str) -> list[str]:
    """How to run a script in this Blender; skips if it is not installed."""
    if why := blenders.lacking(version):
        pytest.skip(why)
    script = str(HERE / "run.py")
    if version == blenders.PROGRAM:
        return ["blender", "-b", "--factory-startup", "--python-exit-code", "1", "--python", script]
    return [str(blenders.python_of(version)), script]


class _Blender:
    """A running Blender that takes scenarios."""

    def __init__(self, version: str, model: Path, folder: Path):
        self.log, self.scenarios = folder / "log.txt", []
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "BLENDER"))}
        environment = kept | {
            "NEURALOCKS_TEST_MODEL": str(model),
            "OMP_NUM_THREADS": "1",
            "BLENDER_USER_RESOURCES": str(folder),
        }
        if version == blenders.PROGRAM:
            environment["PYTHONPATH"] = str(blenders.packages_of("4.2"))
        with open(self.log, "wb") as log:
            self.process = subprocess.Popen(
                _command(version), stdin=subprocess.PIPE, stdout=log, stderr=log, env=environment, cwd=ROOT, text=True
            )

    def run(self, scenario: str, folder: Path) -> str:
        """Empty if the scenario holds, otherwise what went wrong. Raises pytest's skip if this Blender cannot do it."""
        self.scenarios.append(scenario)
        begun, limit = self.log.stat().st_size, SLOW.get(scenario, LIMIT)
        until = time.monotonic() + limit
        with contextlib.suppress(OSError):  # if it has ended, its status says so
            print(scenario, folder, sep="\t", file=self.process.stdin, flush=True)
        while time.monotonic() < until:
            gone = self.process.poll()
            if (folder / "outcome").exists():
                outcome, why = (folder / "outcome").read_text().split("\n", 1)
            elif gone is not None:
                outcome, why = "failed", f"Blender ended with status {gone}"
            else:
                time.sleep(0.02)
                continue
            if outcome == "skipped":
                pytest.skip(why)
            said = self.log.read_bytes()[begun:].decode(errors="replace")[-12000:]
            return "" if outcome == "held" else f"{said}{why}\nIn this process: {', '.join(self.scenarios)}"
        return f"did not end within {limit} s"

    def leave(self) -> None:
        """End it, whatever it is doing."""
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="module")
def running():
    """Running Blenders by version, ended when the tests are."""
    found: dict[str, _Blender] = {}
    yield found
    for each in found.values():
        each.leave()


@pytest.mark.parametrize("version", blenders.asked_for())
@pytest.mark.parametrize(
    "scenario",
    # What is stopped by its own limit says which scenario that was, and leaves a Blender for the next.
    [pytest.param(name, marks=pytest.mark.timeout(SLOW.get(name, LIMIT) + 60)) for name in scenarios.modules()],
)
def test_scenario(version, scenario, running, random_model, tmp_path, tmp_path_factory):
    """Runs one scenario; its output is shown when it fails."""
    if scenario in SLOW and not os.environ.get("NEURALOCKS_SLOW"):
        pytest.skip("takes minutes; set NEURALOCKS_SLOW=1")
    if version not in running:
        running[version] = _Blender(version, random_model, tmp_path_factory.mktemp("blender"))
    wrong = running[version].run(scenario, tmp_path / "work")
    if wrong:
        running.pop(version).leave()
        pytest.fail(wrong)
