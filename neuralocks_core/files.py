# SPDX-License-Identifier: Apache-2.0
"""Files that appear under their name complete or not at all."""

import errno
import glob
import os
import shutil
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from neuralocks_core.errors import CannotWrite, NeuralocksError, fact_of

_HOLDS_OPEN_FILES = os.name == "nt"
_PAUSES = (0.05, 0.2, 0.5)
_ASIDE = ".replaced"
_LETTERS = 8


@contextmanager
def atomic_write(path: str | os.PathLike) -> Iterator[Path]:
    """A path to write to, beside `path`. It replaces `path` when the block ends without an error.

    It has the same name in a hidden folder of its own, since writers choose a format by the extension. Missing folders above
    `path` are created. Enter the block before long work, to learn in time that a folder cannot be written.

    Raises:
        NeuralocksError: it is a folder's name, or (CannotWrite) what is there is write-protected, a device or a pipe, or for every
            OSError in the block; nothing is left of it, and what was under `path` stays.
    """
    path = Path(path)
    if os.path.isdir(path) and not os.path.islink(path):  # a link is replaced, whatever it points to
        raise NeuralocksError(f"{path}: is a folder; move it, or choose another name")
    try:
        made = make_way(path)
        try:
            with scratch_folder(path.parent) as folder:
                part = folder / path.name
                yield part
                reach_disk(part)
                put_in_place(part, path)
        except BaseException:
            remove_empty(made)
            raise
    except OSError as error:
        raise cannot_write(path, error) from None


def check_writable(path: Path) -> None:
    """Check that a path can be written: before minutes of work, not after.

    Raises:
        NeuralocksError: it is a folder's name, a write-protected file, a device or a pipe, or nothing can be written there; nothing
            is left of the attempt.
    """
    if os.path.isdir(path):  # also False for a name too long for a file, or where nobody may look: what follows tells
        raise NeuralocksError(f"{path}: is a folder; give a file name")
    try:
        made = make_way(path)
        try:
            with scratch_folder(path.parent):
                pass
        finally:
            remove_empty(made)
    except OSError as error:
        raise cannot_write(path, error) from None


def replace_npz(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays atomically under the final name; a process killed meanwhile leaves `<stem>.<process>.tmp` beside it.

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
            put_in_place(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise cannot_write(path, error) from None


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """The arrays that `replace_npz` wrote, by name.

    Raises:
        ValueError: the file is damaged, or there is none.
    """
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except Exception:  # of numpy, zipfile and whatever unpacks: an array may also claim more than any memory holds
        raise ValueError("damaged") from None


@contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """A new hidden folder, removed with all its content at the end. Unlike one of `tempfile`, whose private rights on Windows stay
    with files that are moved out of it, it has the usual rights, and it fails at once where no folder can be made.

    Raises:
        OSError: the folder cannot be made.
    """
    folder = parent / f".part-{uuid.uuid4().hex[:12]}"
    folder.mkdir()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def reach_disk(path: Path) -> None:
    """Wait until a file is on the disk: otherwise a power cut may leave an empty file under its later name.

    Raises:
        OSError: the disk refuses.
    """
    with open(path, "rb+") as file:
        os.fsync(file.fileno())


def put_in_place(part: Path, path: Path) -> None:
    """Give a file its final name, replacing what is there.

    Windows replaces no file that a program has open, and virus scanners open files for a moment. So this tries again for about a
    second; then it renames the old file, which Windows allows. The next call removes that file once no program has it open.

    Raises:
        OSError: it cannot be done; both files are unchanged.
    """
    try:
        os.replace(part, path)
        return
    except PermissionError:
        # A read-only file, as under some version controls, stays; and in a folder without write access nothing is renamed.
        if not (_HOLDS_OPEN_FILES and path.is_file() and os.access(path, os.W_OK)):
            raise
    remove_strays(path, _ASIDE)
    for pause in _PAUSES:
        time.sleep(pause)
        with suppress(PermissionError):
            os.replace(part, path)
            return
    aside = stray_name(path, _ASIDE)
    os.rename(path, aside)
    try:
        os.replace(part, path)
    except BaseException:
        os.rename(aside, path)
        raise
    with suppress(OSError):
        aside.unlink()


def stray_name(path: Path, ending: str) -> Path:
    """A new hidden name beside a file, for temporary use."""
    return path.with_name(f".{path.name}.{uuid.uuid4().hex[:_LETTERS]}{ending}")


def remove_strays(path: Path, ending: str) -> None:
    """Remove files with such names beside a file, as far as the system allows."""
    for stray in path.parent.glob(f".{glob.escape(path.name)}.{'[0-9a-f]' * _LETTERS}{ending}"):
        with suppress(OSError):
            stray.unlink()


def make_way(path: Path) -> list[Path]:
    """Create the missing folders above a file that is to be written; returns them, innermost first.

    Raises:
        CannotWrite: the file is there and nobody may write it, as published files and those under some version controls are:
            POSIX systems would let it be replaced all the same. So they would a device, such as /dev/null as root, or a pipe.
        OSError: the file system refuses; none of them is left.
    """
    if path.is_file() and not path.is_symlink() and not path.stat().st_mode & 0o222:
        raise CannotWrite(f"{path}: is write-protected; make it writable, or choose another name")
    if path.exists() and not path.is_file() and not path.is_dir():
        raise CannotWrite(f"{path}: is a device or a pipe, not a file; choose another name")
    missing = [folder for folder in path.parents if not os.path.exists(folder)]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except BaseException:  # the outer ones may be there by now
        remove_empty(missing)
        raise
    return missing


def remove_empty(folders: list[Path]) -> None:
    """Remove those of the folders that are empty."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def as_path(given, name: str) -> Path:
    """The path that a caller gives for the argument `name`.

    Raises:
        NeuralocksError: it is not a path.
    """
    try:
        return Path(given)
    except TypeError:
        raise NeuralocksError(f"{name}: {given!r} is not a path; give text or a pathlib.Path") from None


def cannot_write(path: str | os.PathLike, error: OSError) -> CannotWrite:
    """The one-line error for a file system that refuses."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
        return CannotWrite(f"{path}: no space left on the disk; free some, or choose another folder")
    if error.errno == errno.ENAMETOOLONG:
        return CannotWrite(
            f"{path}: its name is too long for this disk, with what is added to it meanwhile; choose a shorter one"
        )
    if error.errno in (errno.EEXIST, errno.ENOTDIR):
        return CannotWrite(f"{path}: there is a file, not a folder, on the way; choose another folder")
    if _HOLDS_OPEN_FILES and isinstance(error, PermissionError) and os.path.exists(path):
        return CannotWrite(f"{path}: cannot be written; close the program that has it open, or choose another name")
    fact = error.strerror or fact_of(error)
    return CannotWrite(f"{path}: cannot be written ({fact}); choose a folder you can write to")
