# SPDX-License-Identifier: Apache-2.0
"""Where libraries keep compiled code for a user without a writable home folder, as on a farm."""

import os
import stat
import tempfile
from pathlib import Path

from neuralocks_core.errors import NeuralocksError


def own_folder(name: str) -> Path:
    """The folder `name`, made if need be, in one among the temporary files that nobody but its user can put code into.

    Raises:
        NeuralocksError: there can be none.
    """
    owner = os.getuid() if hasattr(os, "getuid") else None
    remedy = "set TMPDIR to a folder of yours that can be written"
    try:
        mine = Path(tempfile.gettempdir()) / f"neuralocks-{'cache' if owner is None else owner}"
        mine.mkdir(mode=0o700, exist_ok=True)
        found = mine.lstat()
        # Where users share that folder, another one may have been there first. Windows gives each a folder.
        if not stat.S_ISDIR(found.st_mode) or owner is not None and (found.st_uid != owner or found.st_mode & 0o077):
            raise NeuralocksError(f"{mine}: is not a folder of yours alone; remove it, or {remedy}")
        (mine / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise NeuralocksError(f"{error.filename or 'cache'}: cannot be written ({error.strerror}); {remedy}") from None
    return mine / name


def writable(folder: Path) -> bool:
    """Whether files can be made in a folder, which is made if need be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)
