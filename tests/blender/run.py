# SPDX-License-Identifier: GPL-3.0-or-later
"""Run one scenario inside a Blender: `python tests/blender/run.py SCENARIO WORK_FOLDER`, with `bpy` importable.

Leaves by `os._exit`: some builds of bpy hang or crash at exit when a handler or class is left, which a failing
scenario does.
"""

import os
import sys
import traceback
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


def main() -> int:
    """0 when the scenario holds."""
    import bpy

    from tests.blender import scenarios, scenes

    name, folder = sys.argv[-2], Path(sys.argv[-1])
    folder.mkdir(parents=True, exist_ok=True)
    import dcc_addon

    dcc_addon.register()
    scenes.empty()
    print(f"{name} in Blender {bpy.app.version_string}")
    getattr(scenarios, name)(folder)
    return 0


if __name__ == "__main__":
    status = 1
    try:
        status = main()
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
