# SPDX-License-Identifier: Apache-2.0
"""`neuralocks`, and `python -m usd`: the command line. Ctrl-C ends it with one word, even while it is still loading."""

import os
import sys

from .border.stopping import end_at_once, stoppable


def main() -> None:
    """Entry point."""
    _never_none()
    # Strands, frames and pictures share the cores. OpenBLAS would start its own threads for every small product, and they spin
    # while they wait for the next one: a clip then takes a third longer. It reads this variable when numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        with stoppable():
            from .cli.app import main as run

            run()
    finally:
        end_at_once()


def _never_none() -> None:
    """Give a process whose caller closed its output, such as a job without a console, somewhere to write."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))


if __name__ == "__main__":
    main()
