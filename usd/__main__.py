# SPDX-License-Identifier: Apache-2.0
"""`neuralocks`, and `python -m usd`: the command line. Ctrl-C ends it in one word, even while it is still loading."""

import os

from .border.stopping import stoppable


def main() -> None:
    """Entry point."""
    # Strands, frames and pictures share the cores. OpenBLAS would start threads of its own for every small product, and
    # they wait for the next one by spinning: a clip takes a third longer with them. It reads this when numpy is imported.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with stoppable():
        from .cli.app import main as run

        run()


if __name__ == "__main__":
    main()
