# SPDX-License-Identifier: Apache-2.0
"""A folder that only one process at a time works in; its lock ends with the process that holds it, even if killed."""

import os
from contextlib import suppress
from pathlib import Path

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import cannot_write

TRIES = 100
"""How often to recreate a folder that others remove, before it counts as theirs."""


class FolderLock:
    """Creates a folder, if it is missing, and locks it.

    Args:
        folder: its path.
        subject: the file or folder that messages are about.
        busy: what messages say if another process is working in the folder.

    Raises:
        NeuralocksError: the folder is locked by another process, it or its lock is a link to somewhere else, or it cannot be made.
    """

    def __init__(self, folder: Path, subject: Path, busy: str):
        self.folder, self._lock = folder, None
        try:
            for _ in range(TRIES):
                folder.mkdir(parents=True, exist_ok=True)
                if folder.is_symlink():
                    raise NeuralocksError(f"{folder}: is a link, and files behind it would be removed; remove the link")
                lock = folder / "lock"
                # Opening a link may make a file elsewhere.
                if lock.is_symlink() or lock.exists() and not lock.is_file():
                    raise NeuralocksError(f"{lock}: is not a plain file, as the lock of this folder is; remove it")
                self._lock = _taken(lock)
                if self._lock is not None:
                    return
        except BlockingIOError:
            pass
        except OSError as error:
            raise cannot_write(subject, error) from None
        raise NeuralocksError(f"{subject}: {busy}")

    @property
    def held(self) -> bool:
        """Whether the folder is still locked."""
        return not self._lock.closed

    def release(self) -> None:
        """Unlock the folder, and remove it if nothing else is in it; does nothing the second time."""
        if not self.held:
            return
        if os.name == "nt":
            self._lock.close()  # Windows does not remove open files
        with suppress(OSError):  # another process has locked it, or it is not empty
            (self.folder / "lock").unlink()
            self.folder.rmdir()
        self._lock.close()


def _taken(path: Path):
    """The locked file; None if its last owner has just removed it. Raises BlockingIOError if it is locked."""
    try:
        lock = open(path, "a+")
    except FileNotFoundError:
        return None
    try:
        _lock(lock)
        # A process that opens the file before it is removed, and locks it afterwards, holds a file that others cannot see. Windows
        # does not remove open files, and its network drives may number one file in two ways.
        if os.name == "nt" or os.path.samestat(os.fstat(lock.fileno()), os.stat(path)):
            return lock
    except FileNotFoundError:
        pass
    except BaseException:
        lock.close()
        raise
    lock.close()
    return None


if os.name == "nt":
    import msvcrt

    def _lock(file) -> None:
        file.seek(0)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except PermissionError as error:
            raise BlockingIOError from error

else:
    import fcntl

    def _lock(file) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
