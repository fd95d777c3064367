# SPDX-License-Identifier: Apache-2.0
"""A file is whole or not there, whatever happens while it is written."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from neuralocks_core import files
from neuralocks_core.errors import CannotWrite, NeuralocksError
from neuralocks_core.files import atomic_write, check_writable, replace_npz
from tests.full_disk import room_for


def test_a_file_takes_its_place_when_it_is_whole(tmp_path):
    path = tmp_path / "new" / "a.txt"
    for text in ("one", "two"):
        with atomic_write(path) as part:
            part.write_text(text)
            assert part.suffix == ".txt" and (not path.exists() or path.read_text() == "one")
    assert path.read_text() == "two" and list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize(
    ("error", "said"),
    [(OSError(errno.ENOSPC, "full"), "no space"), (OSError("odd\nthing"), r"\(odd\)"), (KeyboardInterrupt(), None)],
    ids=["full", "without a number", "interrupted"],
)
def test_a_failure_leaves_what_was_there_and_nothing_beside_it(tmp_path, error, said):
    path = tmp_path / "a.txt"
    path.write_text("old")
    kind = NeuralocksError if isinstance(error, OSError) else type(error)
    with pytest.raises(kind, match=said), atomic_write(path) as part:
        part.write_text("half")
        raise error
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_folders_made_for_what_did_not_come_are_gone(tmp_path):
    with pytest.raises(KeyboardInterrupt), atomic_write(tmp_path / "one" / "two" / "a.txt"):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_is_known_before_the_work(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(NeuralocksError, match="a file, not a folder"), atomic_write(tmp_path / "file" / "a.txt"):
        pytest.fail("the work was begun")


def test_a_name_too_long_for_a_file_is_known_before_the_work(tmp_path):
    with pytest.raises(CannotWrite, match="its name is too long"):
        check_writable(tmp_path / f"{'x' * 300}.usda")
    with pytest.raises(CannotWrite, match="its name is too long"):
        check_writable(tmp_path / "new" / ("x" * 300) / "a.usda")
    assert not any(tmp_path.iterdir())


def test_arrays_that_find_no_room_leave_those_that_were_there(tmp_path):
    path = tmp_path / "a.npz"
    replace_npz(path, {"few": np.arange(3)})
    with pytest.raises(NeuralocksError, match="a.npz: no space"), room_for(10_000):
        replace_npz(path, {"many": np.zeros(10_000)})
    assert np.load(path)["few"].size == 3 and list(tmp_path.iterdir()) == [path]


class _Windows:
    """Refuses, as Windows does, to replace or remove files that a program has mapped, but allows renaming them."""

    def __init__(self, monkeypatch, shown: Path):
        self._shown, self._identity = shown, shown.stat().st_ino
        self._replace, self._unlink = os.replace, Path.unlink
        monkeypatch.setattr(files, "_HOLDS_OPEN_FILES", True)
        monkeypatch.setattr(files, "_PAUSES", (0.0, 0.0))
        monkeypatch.setattr(os, "replace", self.replace)
        monkeypatch.setattr(Path, "unlink", lambda path, missing_ok=False: self.unlink(path, missing_ok))

    def replace(self, source, target):
        self._refuse(target)
        self._replace(source, target)

    def unlink(self, path, missing_ok):
        self._refuse(path)
        self._unlink(path, missing_ok)

    def _refuse(self, path):
        if os.path.exists(path) and os.stat(path).st_ino == self._identity:
            raise PermissionError(13, "Access is denied", str(path))


def test_a_file_that_windows_does_not_replace_steps_aside(tmp_path, monkeypatch):
    path = tmp_path / "hair.usdc"
    path.write_bytes(b"old")
    with monkeypatch.context() as patch:
        _Windows(patch, path)
        for content in (b"new", b"newer"):
            with atomic_write(path) as part:
                part.write_bytes(content)
            assert path.read_bytes() == content
        (aside,) = (other for other in tmp_path.iterdir() if other != path)
        assert aside.read_bytes() == b"old" and aside.name.startswith(".hair.usdc.")
    with monkeypatch.context() as patch:
        _Windows(patch, path)  # the previous one is no longer mapped
        with atomic_write(path) as part:
            part.write_bytes(b"last")
        assert path.read_bytes() == b"last" and len(list(tmp_path.iterdir())) == 2 and not aside.exists()


def test_what_cannot_step_aside_is_told_to_be_open_and_stays(tmp_path, monkeypatch):
    path = tmp_path / "hair.usdc"
    path.write_bytes(b"old")
    with monkeypatch.context() as patch:
        windows = _Windows(patch, path)
        patch.setattr(os, "rename", lambda source, target: windows._refuse(source))
        with pytest.raises(CannotWrite, match="hair.usdc: cannot be written; close the program that has it open"):
            with atomic_write(path) as part:
                part.write_bytes(b"new")
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]


def test_what_windows_lets_nobody_write_stays(tmp_path, monkeypatch):
    path = tmp_path / "hair.usdc"
    path.write_bytes(b"checked in")
    with monkeypatch.context() as patch:
        _Windows(patch, path)
        patch.setattr(os, "access", lambda where, mode: Path(where) != path)
        with pytest.raises(CannotWrite, match="hair.usdc: cannot be written"), atomic_write(path) as part:
            part.write_bytes(b"new")
    assert path.read_bytes() == b"checked in" and list(tmp_path.iterdir()) == [path]


def test_what_nobody_may_write_stays_though_a_folder_would_let_it_be_replaced(tmp_path):
    """As published files are, and those that a version control has not checked out."""
    path = tmp_path / "hair.usdc"
    path.write_bytes(b"published")
    path.chmod(0o444)
    for attempt in (check_writable, lambda path: atomic_write(path).__enter__()):
        with pytest.raises(
            CannotWrite, match="hair.usdc: is write-protected; make it writable, or choose another name"
        ):
            attempt(path)
    assert path.read_bytes() == b"published" and list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names are of POSIX systems")
def test_a_pipe_or_device_stays_what_it_is(tmp_path):
    """Whoever may write into its folder could replace it: root, as in a container, would lose /dev/null."""
    pipe, link = tmp_path / "pipe.usdc", tmp_path / "link.usdc"
    os.mkfifo(pipe)
    link.symlink_to(os.devnull)
    for path in (pipe, link):
        for attempt in (check_writable, lambda path: atomic_write(path).__enter__()):
            with pytest.raises(
                CannotWrite, match=f"{path.name}: is a device or a pipe, not a file; choose another name"
            ):
                attempt(path)
    assert pipe.is_fifo() and link.is_symlink() and {*tmp_path.iterdir()} == {pipe, link}
