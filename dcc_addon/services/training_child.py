# SPDX-License-Identifier: GPL-3.0-or-later
"""Run by a Python with torch: reads settings as JSON from standard input, trains, and says how far it is, a JSON
object a line.
"""

import importlib
import json
import sys


def main() -> int:
    """Train strands or hair bones; exit status 1 with an `error` line for what a user can mend."""
    if "--check" in sys.argv:
        try:
            for needed in ("torch", "neuralocks_core.training.train", "usd.training"):
                importlib.import_module(needed)
        except ImportError as error:
            print(f"it lacks '{error.name}'", file=sys.stderr)
            return 1
        return 0
    settings = json.load(sys.stdin)
    say = _printer(sys.stdout)
    from neuralocks_core.errors import NeuralocksError

    try:
        (_train_rig if settings["kind"] == "rig" else _train_strands)(settings, say)
    except NeuralocksError as error:
        print(json.dumps({"error": str(error)}), flush=True)
        return 1
    return 0


def _printer(stream):
    def say(done: int, total: int, message: str) -> None:
        print(json.dumps({"done": done / max(total, 1), "message": message}), file=stream, flush=True)

    return say


def _train_strands(settings: dict, say) -> None:
    from neuralocks_core.training.regression import RegressionOptions
    from neuralocks_core.training.train import train_strands
    from usd.training import training_scene

    say(0, 1, "Reading the character")
    scene = training_scene(settings["character"], motion=[settings["character"]], seed=0)
    options = RegressionOptions(minutes=settings["minutes"])
    train_strands(scene, settings["out"], options, rollouts=settings.get("rollouts", 1200), progress=say)


def _train_rig(settings: dict, say) -> None:
    from usd.rig_train import train_rig

    say(0, 1, "Reading the character")
    train_rig(settings["character"], settings["out"], minutes=settings["minutes"], progress=say)


if __name__ == "__main__":
    sys.exit(main())
