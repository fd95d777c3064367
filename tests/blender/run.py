# SPDX-License-Identifier: GPL-3.0-or-later
r"""Run scenarios inside a Blender, one after another, as they come on standard input: NAME, a tab, and a work folder a line.

Each begins with an empty file and the add-on enabled, and leaves it so; its outcome is then in its folder. By hand, with
`bpy` importable: `printf 'posing\t/tmp/work' | python tests/blender/run.py; cat /tmp/work/outcome`.
"""

import importlib
import sys
import traceback
from pathlib import Path
from unittest import SkipTest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


def main() -> None:
    """Returns at the end of standard input."""
    import bpy

    import dcc_addon
    from dcc_addon.operators import training
    from dcc_addon.services.training.trainers import Trainers
    from tests.blender import scenarios, scenes

    dcc_addon.register()
    training._trainers = Trainers(lambda _python: "")  # a real answer takes seconds; `second_python` asks for one
    modules = scenarios.modules()
    print(f"Blender {bpy.app.version_string}", flush=True)
    for line in sys.stdin:
        name, folder = line.rstrip("\n").split("\t")
        Path(folder).mkdir(parents=True, exist_ok=True)
        try:
            scenes.empty()
            getattr(importlib.import_module(modules[name]), name)(Path(folder))
            outcome, why = "held", ""
        except SkipTest as reason:
            outcome, why = "skipped", str(reason)
        except Exception:
            outcome, why = "failed", traceback.format_exc()
        sys.stdout.flush()
        (Path(folder) / "outcome.part").write_text(f"{outcome}\n{why}")
        (Path(folder) / "outcome.part").rename(Path(folder) / "outcome")


if __name__ == "__main__":
    from examples.blender_exit import run_and_leave

    run_and_leave(main)
