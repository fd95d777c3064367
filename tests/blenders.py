# SPDX-License-Identifier: Apache-2.0
"""The Blenders that tests run in: Python environments with a Blender wheel, made by `make blender` and `make matrix`.

Only those count that carry the mark of a finished installation: one whose download failed has a Python without bpy.
"""

import os
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
VERSIONS = ("4.2", "4.5", "5.0", "5.2")
"""What `make matrix` installs; of these, `make blender` the first and the last."""
PROGRAM = "3.4"
"""The version that the program `blender` of a Linux distribution has to be."""


def asked_for() -> list[str]:
    """Versions to run the add-on's scenarios in: those of NEURALOCKS_BLENDERS, or the oldest and the newest.

    One that was asked for and cannot run fails here: skipped, its tests would look as if they had been run. Of `all`, the program
    alone is skipped, because not every system can have it.
    """
    given = os.environ.get("NEURALOCKS_BLENDERS")
    if not given:
        return [VERSIONS[0], VERSIONS[-1]]
    wanted = list(VERSIONS) if given == "all" else given.split(",")
    if why := [lacking(version) for version in wanted if lacking(version)]:
        pytest.fail(f"NEURALOCKS_BLENDERS={given}: {'; '.join(why)}", pytrace=False)
    return [*wanted, PROGRAM] if given == "all" else wanted


def lacking(version: str) -> str:
    """Why one Blender, such as "4.2", cannot run, and the remedy; empty if it can."""
    if version == PROGRAM:
        return "" if shutil.which("blender") else f"no program `blender` is there; install Blender {PROGRAM}"
    if _python(version) in installed():
        return ""
    command = "make blender" if version in (VERSIONS[0], VERSIONS[-1]) else "make matrix"
    remedy = f"{command} installs it" if version in VERSIONS else f"choose among {', '.join((PROGRAM, *VERSIONS))}"
    return f"Blender {version} is not installed as a Python module ({remedy})"


def installed() -> list[Path]:
    """The Python of each installed Blender, from the oldest on."""
    return [mark.parent / "bin" / "python" for mark in sorted(ROOT.glob(".venv-blender-*/installed"))]


def python_of(version: str) -> Path:
    """The Python of one Blender, such as "4.2"; skips the test if that is not installed."""
    if why := lacking(version):
        pytest.skip(why)
    return _python(version)


def packages_of(version: str) -> Path:
    """The folder of one Blender's installed packages; skips the test if that is not installed."""
    return next((python_of(version).parents[1] / "lib").glob("python*/site-packages"))


def _python(version: str) -> Path:
    return ROOT / f".venv-blender-{version}" / "bin" / "python"
