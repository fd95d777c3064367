# SPDX-License-Identifier: GPL-3.0-or-later
"""Restores the files of work that is refused, fails or is cancelled half-way."""

import os
import shutil
from contextlib import contextmanager, suppress
from pathlib import Path

from neuralocks_core.files import cannot_write, put_in_place, remove_empty, remove_strays, stray_name

_BEFORE = ".before"


@contextmanager
def undone_on_failure(*paths: Path):
    """Meanwhile files may be written, each whole or not at all; what was there before, or nothing, comes back unless all
    ends well.

    Raises:
        NeuralocksError: what is there cannot be kept meanwhile.
    """
    made = [folder for path in paths for folder in path.parents if not folder.exists()]
    # Windows removes no file that a program shows: what stays of an earlier time must not be in the way.
    kept = {path: stray_name(path, _BEFORE) for path in paths if path.is_file()}
    try:
        for path in kept:
            remove_strays(path, _BEFORE)
        for path, before in kept.items():
            _keep(path, before)
        try:
            yield
        except BaseException:
            for path in paths:
                with suppress(OSError):  # what went wrong before is what is told
                    if path not in kept:
                        path.unlink(missing_ok=True)
                    elif kept[path].exists():
                        put_in_place(kept[path], path)
            remove_empty(made)
            raise
    finally:
        for before in kept.values():
            with suppress(OSError):
                before.unlink(missing_ok=True)


def _keep(path: Path, before: Path) -> None:
    """Another name for a file, which what is put in its place does not change."""
    try:
        try:
            os.link(path, before)
        except OSError:  # not on this file system
            shutil.copy2(path, before)
    except OSError as error:
        raise cannot_write(path, error) from None
