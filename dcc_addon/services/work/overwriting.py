# SPDX-License-Identifier: GPL-3.0-or-later
"""Files may be overwritten only if this program made them for the same character, since the panel does not ask first."""

import itertools
import os
from pathlib import Path

from neuralocks_core.errors import NeuralocksError


def untaken(path: Path, label: str, taken) -> Path:
    """The file `path`; if that is taken, one named after it and `label`, with a number if needed.

    Args:
        taken: whether something else needs the file at a path.
    """
    numbers = ("" if n == 1 else f"_{n}" for n in itertools.count(1))
    others = (path.with_name(f"{path.stem}_{label}{number}{path.suffix}") for number in numbers)
    return next(found for found in itertools.chain([path], others) if not taken(found))


def check_ours(paths, made_here) -> None:
    """Refuse to overwrite files made by something else.

    Args:
        paths: of the files to write; some may exist.
        made_here: whether the file at a path was made by Neuralocks.

    Raises:
        NeuralocksError: one was not.
    """
    for path in paths:
        if os.path.isfile(path) and not made_here(path):
            raise NeuralocksError(
                f"{path}: would be overwritten, but Neuralocks did not make it; choose another file name, or move it away"
            )
