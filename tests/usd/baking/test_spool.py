# SPDX-License-Identifier: Apache-2.0
"""Finished frames beside the output: whatever lies there already, one line or a clean start."""

import errno
import shutil
from pathlib import Path

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from usd.baking.spool import Spool


def test_a_damaged_mark_means_a_fresh_start(tmp_path):
    folder = tmp_path / ".bake.usdc.baking"
    folder.mkdir()
    (folder / "inputs").write_bytes(b"\xff\xfe\x00")
    (folder / "0_0x1p+0.frame").write_bytes(bytes(12))
    spool = Spool(tmp_path / "bake.usdc", "a")
    assert not spool.holds(0, 1.0, 1)
    spool.close()


def test_a_folder_that_cannot_be_cleared_is_one_line(tmp_path):
    (tmp_path / ".bake.usdc.baking" / "0_0x1p+0.frame").mkdir(parents=True)
    with pytest.raises(NeuralocksError, match="cannot be written"):
        Spool(tmp_path / "bake.usdc", "a")


def test_a_disk_without_room_for_a_mark_is_left_as_it_was(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(NeuralocksError, match="no space left"):
        Spool(tmp_path / "bake.usdc", "a")
    assert not list(tmp_path.iterdir())


def test_the_folder_is_locked_until_it_is_gone(tmp_path, monkeypatch):
    pytest.importorskip("fcntl")
    spool, remove = Spool(tmp_path / "bake.usdc", "a"), shutil.rmtree

    def checked(folder, **options):
        with pytest.raises(NeuralocksError, match="another bake"):
            Spool(tmp_path / "bake.usdc", "b")
        remove(folder, **options)

    monkeypatch.setattr(shutil, "rmtree", checked)
    spool.discard()
    assert not list(tmp_path.iterdir())


def test_a_stop_leaves_finished_frames_and_nothing_else(tmp_path):
    for finished in (False, True):
        spool = Spool(tmp_path / "bake.usdc", "a")
        if finished:
            spool.write(0, 1.0, np.zeros((2, 3)))
        spool.close()
        assert (tmp_path / ".bake.usdc.baking").exists() == finished
    again = Spool(tmp_path / "bake.usdc", "a")
    assert again.holds(0, 1.0, 2)
    again.discard()


def test_a_folder_made_for_an_output_that_did_not_come_is_gone(tmp_path):
    Spool(tmp_path / "new" / "bake.usdc", "a").close()
    assert not list(tmp_path.iterdir())
