# SPDX-License-Identifier: Apache-2.0
"""A folder that one process at a time works in; its lock ends with the process that holds it, however that ends."""

import os
import shutil
from pathlib import Path

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import cannot_write

try:
    import fcntl
except ImportError:  # Windows: two at a time are then not told apart
    fcntl = None


class FolderLock:
    """Makes a folder, if it is missing, and holds it.

    Args:
        folder: its path.
        subject: the file or folder that messages are about.
        busy: what to say of that where another process is at work in the folder.

    Raises:
        NeuralocksError: it is held by another process, or it cannot be made.
    """

    def __init__(self, folder: Path, subject: Path, busy: str):
        self.folder, self._lock = folder, None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = open(folder / "lock", "a+")
            if fcntl is not None:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._lock.close()
            raise NeuralocksError(f"{subject}: {busy}") from None
        except OSError as error:
            if self._lock is not None:
                self._lock.close()
            raise cannot_write(subject, error) from None

    @property
    def alone(self) -> bool:
        """Whether nothing else is in the folder."""
        return self.folder.is_dir() and os.listdir(self.folder) == ["lock"]

    def release(self, remove: bool) -> None:
        """Let go of the folder, and remove it with all that is in it if that is wanted."""
        if os.name == "nt":
            self._lock.close()  # Windows removes no open file
        if remove:
            # Before the lock is given up: another process that takes it would lose what is its own.
            shutil.rmtree(self.folder, ignore_errors=True)
        self._lock.close()
