# SPDX-License-Identifier: Apache-2.0
"""Where libraries keep compiled code for a user without a writable home folder, as on a farm."""

import os
import stat
import tempfile
from pathlib import Path

from neuralocks_core.errors import NeuralocksError


def cache_folder(name: str) -> Path:
    """The folder `name`, created if needed, in a temporary folder into which only its user can put code.

    Raises:
        NeuralocksError: no such folder can be made.
    """
    owner = os.getuid() if hasattr(os, "getuid") else None
    remedy = "set TMPDIR to a folder of yours that can be written"
    try:
        mine = Path(tempfile.gettempdir()) / f"neuralocks-{'cache' if owner is None else owner}"
        mine.mkdir(mode=0o700, exist_ok=True)
        found = mine.lstat()
        # If users share the temporary folder, another user may have been first. Windows gives each user a folder.
        if not stat.S_ISDIR(found.st_mode) or owner is not None and (found.st_uid != owner or found.st_mode & 0o077):
            raise NeuralocksError(f"{mine}: is not a folder of yours alone; remove it, or {remedy}")
        (mine / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise NeuralocksError(f"{error.filename or 'cache'}: cannot be written ({error.strerror}); {remedy}") from None
    return mine / name


def writable(folder: Path) -> bool:
    """Whether files can be created in a folder; creates the folder if needed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
