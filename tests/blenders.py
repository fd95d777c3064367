# SPDX-License-Identifier: Apache-2.0
"""The Blenders that tests run in: Python environments with a Blender wheel, made by `make blender`.

Only those count that carry the mark of a finished installation: one whose download failed has a Python without bpy.
"""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def installed() -> list[Path]:
    """The Python of each installed Blender, from the oldest on."""
    return [mark.parent / "bin" / "python" for mark in sorted(ROOT.glob(".venv-blender-*/installed"))]


def python_of(version: str) -> Path:
    """The Python of one Blender, such as "4.2"; skips the test if that is not installed."""
    python = ROOT / f".venv-blender-{version}" / "bin" / "python"
    if python not in installed():
        pytest.skip(f"Blender {version} is not installed as a Python module (make blender installs 4.2 and 5.2)")
    return python


def packages_of(version: str) -> Path:
    """The folder of one Blender's installed packages; skips the test if that is not installed."""
    return next((python_of(version).parents[1] / "lib").glob("python*/site-packages"))
