# SPDX-License-Identifier: Apache-2.0
"""Files that appear under their name whole or not at all."""

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from neuralocks_core.errors import CannotWrite, NeuralocksError


@contextmanager
def atomic_write(path: str | os.PathLike) -> Iterator[Path]:
    """A path to write to beside `path`, which takes its place when the block ends without an error.

    It has the same name in a hidden folder of its own, since writers choose a format by the ending. Missing folders on
    the way to `path` are made. Enter it before long work, to learn in time that a folder cannot be written.

    Raises:
        NeuralocksError: it is a folder's name, or (CannotWrite) for every OSError in the block; nothing is left of it, and what
            was under `path` stays.
    """
    path = Path(path)
    if os.path.isdir(path) and not os.path.islink(path):  # a link is replaced, whatever it leads to
        raise NeuralocksError(f"{path}: is a folder; move it, or choose another name")
    try:
        made = make_way(path)
        try:
            with tempfile.TemporaryDirectory(dir=path.parent, prefix=".part-", ignore_cleanup_errors=True) as folder:
                part = Path(folder) / path.name
                yield part
                with open(part, "rb+") as file:  # else a power cut may leave the name with nothing under it
                    os.fsync(file.fileno())
                os.replace(part, path)
        except BaseException:
            remove_empty(made)
            raise
    except OSError as error:
        raise cannot_write(path, error) from None


def replace_npz(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays at once under the final name; what is killed over it leaves `<stem>.<process>.tmp` beside it.

    Raises:
        CannotWrite: the file system refuses.
    """
    temporary = path.with_suffix(f".{os.getpid()}.tmp")
    try:
        try:
            with open(temporary, "wb") as file:
                np.savez(file, **arrays)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise cannot_write(path, error) from None


def make_way(path: Path) -> list[Path]:
    """Make the missing folders on the way to a file; returns them, the innermost first."""
    missing = [folder for folder in path.parents if not os.path.exists(folder)]
    path.parent.mkdir(parents=True, exist_ok=True)
    return missing


def remove_empty(folders: list[Path]) -> None:
    """Remove those folders that nothing was put into."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def as_path(given, name: str) -> Path:
    """The path that a caller gives for the argument `name`.

    Raises:
        NeuralocksError: it is none.
    """
    try:
        return Path(given)
    except TypeError:
        raise NeuralocksError(f"{name}: {given!r} is no path; give text or a pathlib.Path") from None


def cannot_write(path: str | os.PathLike, error: OSError) -> CannotWrite:
    """The one line for a file system that refuses."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return CannotWrite(f"{path}: no space left on the disk; free some, or choose another folder")
    if error.errno in (errno.EEXIST, errno.ENOTDIR):
        return CannotWrite(f"{path}: there is a file, not a folder, on the way; choose another folder")
    fact = error.strerror or (str(error) or type(error).__name__).splitlines()[0]
    return CannotWrite(f"{path}: cannot be written ({fact}); choose a folder you can write to")
