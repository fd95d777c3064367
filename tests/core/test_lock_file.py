# SPDX-License-Identifier: Apache-2.0
"""One process at a time in a folder."""

import pytest

from neuralocks_core import lock_file
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.lock_file import FolderLock


def test_second_is_refused(tmp_path):
    """While it is held, and not afterwards; the folder's content stays, and an empty folder is removed."""
    folder = tmp_path / "work"
    first = FolderLock(folder, folder, "busy")
    (folder / "kept").touch()
    with pytest.raises(NeuralocksError, match="busy"):
        FolderLock(folder, folder, "busy")
    first.release()
    assert [path.name for path in folder.iterdir()] == ["kept"]
    second = FolderLock(folder, folder, "busy")
    (folder / "kept").unlink()
    second.release()
    assert not folder.exists()


def test_removed_while_it_is_opened(tmp_path, monkeypatch):
    """A process that waits while the folder is removed holds the recreated one, not the one that is gone."""
    folder = tmp_path / "work"
    first = FolderLock(folder, folder, "busy")
    fcntl = pytest.importorskip("fcntl")
    lock, holders = fcntl.flock, [first]

    def left_in_between(*arguments):
        if holders:
            holders.pop().release()
        lock(*arguments)

    monkeypatch.setattr(fcntl, "flock", left_in_between)
    second = FolderLock(folder, folder, "busy")
    with pytest.raises(NeuralocksError, match="busy"):
        FolderLock(folder, folder, "busy")
    second.release()


def test_no_folder_can_be_made(tmp_path, monkeypatch):
    """The message names what the caller is doing."""
    (tmp_path / "file").touch()
    with pytest.raises(NeuralocksError, match="hair.usdc"):
        FolderLock(tmp_path / "file", tmp_path / "hair.usdc", "busy")
    monkeypatch.setattr(lock_file, "_taken", lambda path: None)  # others always remove it meanwhile
    with pytest.raises(NeuralocksError, match="busy"):
        FolderLock(tmp_path / "work", tmp_path / "work", "busy")


@pytest.mark.parametrize("kind", ["folder", "link"])
def test_what_is_no_lock_is_named(tmp_path, kind):
    """A link would let a file be made wherever it leads."""
    lock, elsewhere = tmp_path / "work" / "lock", tmp_path / "elsewhere"
    lock.parent.mkdir()
    lock.mkdir() if kind == "folder" else lock.symlink_to(elsewhere)
    with pytest.raises(NeuralocksError, match=r"work.lock: is not a plain file, .*; remove it"):
        FolderLock(lock.parent, tmp_path / "out.usda", "busy")
    assert not elsewhere.exists()
