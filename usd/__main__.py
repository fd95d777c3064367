# SPDX-License-Identifier: Apache-2.0
"""`neuralocks`, and `python -m usd`: the command line. Ctrl-C ends it with one word, even while it is still loading."""

import os
import sys

from .border.stopping import end_at_once, stoppable


def main() -> None:
    """Entry point."""
    _never_none()
    # Strands, frames and pictures share the cores. OpenBLAS would start threads of its own for every small product, and
    # they wait for the next one by spinning: a clip takes a third longer with them. It reads this when numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        with stoppable():
            from .cli.app import main as run

            run()
    finally:
        end_at_once()


def _never_none() -> None:
    """Give a process whose output was closed by its caller, as a job without a console may be, somewhere to write."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))


if __name__ == "__main__":
    main()
