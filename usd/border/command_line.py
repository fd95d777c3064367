# SPDX-License-Identifier: Apache-2.0
"""The running command line, for the card of a model that it trains."""

import shlex
import sys
from pathlib import Path


def command_line() -> str:
    """The running command line; empty if it is not one of ours."""
    program = Path(sys.argv[0])
    ours = program.name.startswith("neuralocks") or program.parts[-2:] == ("usd", "__main__.py")
    return shlex.join(["neuralocks", *sys.argv[1:]]) if ours else ""
