# SPDX-License-Identifier: GPL-3.0-or-later
"""Run by a Python with torch: reads settings as JSON from standard input, trains, and reports progress, one JSON object
per line.
"""

import json
import os
import sys

LEARNED, AROUND = 30.0, 100.0
"""Seconds that the bones' network learns at least, and that the simulations before it and the report after it take."""


def main() -> int:
    """Train strands or hair bones; exit status 1 with an `error` line for what a user can fix."""
    settings = json.load(sys.stdin)
    say = _progress()
    from neuralocks_core.errors import NeuralocksError
    from neuralocks_core.training.work_folder import abandon

    try:
        (_train_rig if settings["kind"] == "rig" else _train_strands)(settings, say)
    except NeuralocksError as error:
        _send(error=str(error))
        return 1
    finally:
        abandon(settings["out"])  # also if Blender is gone: its next training does not resume from there
    return 0


def _send(**said) -> None:
    """Report to Blender."""
    print(json.dumps(said), flush=True)


def _progress():
    parent = os.getppid()

    def say(done: int, total: int, message: str) -> None:
        if os.getppid() != parent:  # Blender is gone, and nobody waits for the model
            sys.exit(1)
        _send(done=done / max(total, 1), message=message)

    return say


def _tell(notes) -> None:
    """Report notes on the character, or on what was learned."""
    _send(notes=[str(note) for note in notes])


def _train_strands(settings: dict, say) -> None:
    from neuralocks_core.training.train import THOUSANDTHS
    from usd.models.train import train

    def told(done: int, total: int, message: str) -> None:
        if total == THOUSANDTHS:
            say(done, total, message)
        else:  # progress of the work before the training time begins
            say(0, 1, message)
            _send(before=done / max(total, 1))

    say(0, 1, "Reading the character")
    character, minutes = settings["character"], settings["minutes"]
    # A short training cannot use more simulations than it has time to make.
    rollouts = max(24, min(4000, int(80 * minutes)))
    train(
        character,
        [],
        [character],
        settings["out"],
        {"minutes": minutes},
        head=settings.get("head"),
        rollouts=rollouts,
        tell=_tell,
        progress=told,
    )


def _train_rig(settings: dict, say) -> None:
    from usd.rig.train import train_rig

    say(0, 1, "Reading the character")
    seconds = 60 * settings["minutes"]
    train_rig(
        settings["character"],
        settings["out"],
        seconds=max(min(seconds, LEARNED), seconds - AROUND),
        chains=settings.get("chains") or None,
        head=settings.get("head"),
        tell=_tell,
        progress=say,
    )


if __name__ == "__main__":
    sys.exit(main())
