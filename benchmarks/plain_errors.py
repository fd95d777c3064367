# SPDX-License-Identifier: Apache-2.0
"""Imported by the other benchmarks: what they lack, or cannot use, is then told in words, without a traceback."""

import sys
from pathlib import Path

from neuralocks_core.errors import NeuralocksError

EXTRAS = {
    "torch": "train", "onnx": "train", "warp": "train", "newton": "compare", "matplotlib": "compare", "trimesh": "test"
}  # fmt: skip
"""Module -> the extra that brings it (pyproject.toml)."""


def told(kind, error, trace) -> None:
    """As `sys.excepthook`."""
    module = (error.name or "").split(".")[0] if isinstance(error, ModuleNotFoundError) else ""
    if module in EXTRAS:
        error = NeuralocksError(f'{module}: is not installed; pip install ".[{EXTRAS[module]}]"')
    if isinstance(error, NeuralocksError):
        print(f"{Path(sys.argv[0]).stem}: {error}", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


sys.excepthook = told
