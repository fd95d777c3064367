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
    """In this block, files may be written, each whole or not at all; if it fails, the previous files, or none, come back.

    Raises:
        NeuralocksError: an existing file cannot be kept meanwhile.
    """
    made = [folder for path in paths for folder in path.parents if not folder.exists()]
    # Windows does not remove a file that a program uses: left-overs from an earlier time must not be in the way.
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
                with suppress(OSError):  # the earlier error is the one to report
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
    """Give a file another name, so that replacing the original does not change it."""
    try:
        try:
            os.link(path, before)
        except OSError:  # no hard links on this file system
            shutil.copy2(path, before)
    except OSError as error:
        raise cannot_write(path, error) from None
