# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of work that is refused, fails or is cancelled half-way: as they were before it."""

import os
import shutil
from contextlib import contextmanager
from pathlib import Path

from neuralocks_core.files import cannot_write, remove_empty


@contextmanager
def undone_on_failure(*paths: Path):
    """Meanwhile files may be written, each whole or not at all; what was there before, or nothing, comes back unless all
    ends well.

    Raises:
        NeuralocksError: what is there cannot be kept meanwhile.
    """
    made = [folder for path in paths for folder in path.parents if not folder.exists()]
    kept = {path: path.with_name(f".{path.name}.before") for path in paths if path.is_file()}
    try:
        for path, before in kept.items():
            _keep(path, before)
        try:
            yield
        except BaseException:
            for path in paths:
                if path not in kept:
                    path.unlink(missing_ok=True)
                elif kept[path].exists():
                    os.replace(kept[path], path)
            remove_empty(made)
            raise
    finally:
        for before in kept.values():
            before.unlink(missing_ok=True)


def _keep(path: Path, before: Path) -> None:
    """Another name for a file, which what is put in its place does not change."""
    before.unlink(missing_ok=True)
    try:
        os.link(path, before)
    except OSError:  # not on this file system
        try:
            shutil.copy2(path, before)
        except OSError as error:
            raise cannot_write(path, error) from None
