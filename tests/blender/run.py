# SPDX-License-Identifier: GPL-3.0-or-later
"""Run one scenario inside a Blender: `python tests/blender/run.py SCENARIO WORK_FOLDER`, with `bpy` importable."""

import importlib
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


def main() -> None:
    """Raises when the scenario does not hold."""
    import bpy

    from tests.blender import scenarios, scenes

    name, folder = sys.argv[-2], Path(sys.argv[-1])
    folder.mkdir(parents=True, exist_ok=True)
    import dcc_addon

    dcc_addon.register()
    scenes.empty()
    print(f"{name} in Blender {bpy.app.version_string}")
    getattr(importlib.import_module(scenarios.modules()[name]), name)(folder)


if __name__ == "__main__":
    from examples.blender_exit import run_and_leave

    run_and_leave(main)
