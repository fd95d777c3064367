# SPDX-License-Identifier: GPL-3.0-or-later
"""Run by a Python to say whether it can train. The syntax is old enough for any Python to run it and say that it is too old."""

import importlib
import sys

PYTHON = (3, 11)
"""The oldest that the packages run with."""
CAN = "this Python can train"
"""What no other program prints on success."""


def lacking():
    """Why this Python cannot train; empty if it can."""
    if tuple(sys.version_info[:2]) < PYTHON:
        return "it is Python " + sys.version.split()[0] + ", and " + ".".join(map(str, PYTHON)) + " or newer is needed"
    for needed in ("torch", "warp", "onnx", "usd.models.train"):
        try:
            importlib.import_module(needed)
        except ModuleNotFoundError as error:
            return "it lacks '" + str(error.name) + "'"
        except Exception as error:  # for example, a library that its compiled part needs is missing
            return "its '" + needed + "' does not load (" + (" ".join(str(error).split()) or type(error).__name__) + ")"
    return ""


def main():
    """Print the reason to standard error, with exit status 1, or print `CAN`."""
    fact = lacking()
    (sys.stderr if fact else sys.stdout).write((fact or CAN) + "\n")
    return 1 if fact else 0


if __name__ == "__main__":
    sys.exit(main())
