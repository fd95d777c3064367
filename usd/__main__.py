# SPDX-License-Identifier: Apache-2.0
"""`neuralocks`, and `python -m usd`: the command line, which Ctrl-C ends in one word while it is still being read, too."""

import sys


def main() -> None:
    """Entry point."""
    try:
        from .cli import main as run
    except KeyboardInterrupt:
        print("stopped", file=sys.stderr)
        sys.exit(130)
    run()


if __name__ == "__main__":
    main()
