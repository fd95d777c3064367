# SPDX-License-Identifier: GPL-3.0-or-later
"""What is on the disk after work that is refused, fails or is cancelled half-way."""

import errno
import os
import shutil
from pathlib import Path

import pytest

from dcc_addon.services.work.unfinished import undone_on_failure
from neuralocks_core.errors import NeuralocksError


@pytest.mark.parametrize("links", [True, False])
def test_failed_work_leaves_files_and_folders_as_they_were(tmp_path, monkeypatch, links):
    if not links:
        monkeypatch.setattr(os, "link", _no_links)
    old, new = tmp_path / "hair.usdc", tmp_path / "made" / "other.usdc"
    old.write_bytes(b"earlier")
    with pytest.raises(ValueError), undone_on_failure(old, new):
        new.parent.mkdir()
        new.write_bytes(b"new")
        _put(old, b"new")
        raise ValueError
    assert old.read_bytes() == b"earlier" and list(tmp_path.iterdir()) == [old]


@pytest.mark.parametrize("links", [True, False])
def test_work_that_ends_well_stays(tmp_path, monkeypatch, links):
    if not links:
        monkeypatch.setattr(os, "link", _no_links)
    old = tmp_path / "hair.usdc"
    old.write_bytes(b"earlier")
    with undone_on_failure(old):
        _put(old, b"new")
    assert old.read_bytes() == b"new" and list(tmp_path.iterdir()) == [old]


def test_a_disk_too_full_to_keep_what_is_there_takes_nothing_of_it(tmp_path, monkeypatch):
    def half(path, to):
        Path(to).write_bytes(Path(path).read_bytes()[:10])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "link", _no_links)
    first, second = tmp_path / "hair.usdc", tmp_path / "hair_shot.usdc"
    first.write_bytes(b"x" * 1000)
    second.write_bytes(b"y" * 1000)
    copies = [shutil.copy2, half]
    monkeypatch.setattr(shutil, "copy2", lambda path, to: copies.pop(0)(path, to))
    with pytest.raises(NeuralocksError, match="no space left"), undone_on_failure(first, second):
        raise AssertionError("it began")
    assert not copies
    assert first.read_bytes() == b"x" * 1000 and second.read_bytes() == b"y" * 1000
    assert sorted(tmp_path.iterdir()) == [first, second]


def _no_links(*_):
    raise OSError(errno.EPERM, "no links here")


def _put(path: Path, content: bytes) -> None:
    """Replace a file as a whole, as writers do."""
    part = path.with_name("part")
    part.write_bytes(content)
    os.replace(part, path)


def test_files_whose_names_are_alike_all_come_back(tmp_path):
    names = ("h.usd.x.usd", "h.usd", "shot[1].usdc", "shot1.usdc", "a**b.usdc")
    for name in names:
        (tmp_path / name).write_bytes(name.encode())
    with pytest.raises(ValueError), undone_on_failure(*(tmp_path / name for name in names)):
        for name in names:
            _put(tmp_path / name, b"new")
        raise ValueError
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {name: name.encode() for name in names}


def test_what_a_killed_work_left_is_gone_after_the_next(tmp_path):
    path = tmp_path / "shot[1].usdc"
    path.write_bytes(b"earlier")
    (tmp_path / ".shot[1].usdc.0123abcd.before").write_bytes(b"left")
    with undone_on_failure(path):
        pass
    assert list(tmp_path.iterdir()) == [path]
