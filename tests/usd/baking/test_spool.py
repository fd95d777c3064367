# SPDX-License-Identifier: Apache-2.0
"""Finished frames beside the output: whatever lies there already, one line or a clean start."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from neuralocks_core.errors import CannotWrite, NeuralocksError
from usd.baking.layer.spool import Spool, _remove, fingerprint, program_files


def read(spool, code, rows, batch=0):
    points = np.zeros((rows.stop - rows.start, 3), np.float32)
    spool.read(batch, code, rows.start, points)
    return points


def test_a_damaged_mark_means_a_fresh_start(tmp_path):
    folder = tmp_path / ".bake.usdc.baking"
    folder.mkdir()
    (folder / "inputs").write_bytes(b"\xff\xfe\x00")
    (folder / "0_0x1p+0.frame").write_bytes(bytes(12))
    spool = Spool(tmp_path / "bake.usdc", "a")
    assert not spool.holds(0, 1.0, 1)
    spool.close()


def test_a_folder_that_cannot_be_cleared_is_one_line(tmp_path, monkeypatch):
    (tmp_path / ".bake.usdc.baking").mkdir()
    (tmp_path / ".bake.usdc.baking" / "0_0x1p+0.frame").touch()
    monkeypatch.setattr(Path, "unlink", lambda *_, **__: (_ for _ in ()).throw(PermissionError(errno.EPERM, "no")))
    with pytest.raises(NeuralocksError, match="cannot be written"):
        Spool(tmp_path / "bake.usdc", "a")


@pytest.mark.parametrize("points", [1, 2, 50001])
def test_frames_that_were_left_damaged_are_not_taken_over(tmp_path, points):
    """A power cut leaves zeros, or half of a frame, under a name and with a size that are right."""
    array = np.random.default_rng(0).normal(size=(points, 3)).astype(np.float32)
    spool = Spool(tmp_path / "bake.usdc", "a")
    for code in (1.0, 2.0, -3.5):
        spool.write(0, code, array)
        assert spool.holds(0, code, points)
    spool.close()
    *_, second, third = files = sorted((tmp_path / ".bake.usdc.baking").glob("*.frame"))
    assert len(files) == 3
    third.write_bytes(bytes(third.stat().st_size))
    changed = bytearray(second.read_bytes())
    changed[5] ^= 64
    second.write_bytes(changed)
    again = Spool(tmp_path / "bake.usdc", "a")
    whole = [code for code in (1.0, 2.0, -3.5) if again.holds(0, code, points)]
    assert [again._path(0, code) for code in whole] == files[:1]
    assert np.array_equal(read(again, whole[0], slice(points // 2, points)), array[points // 2 :])
    again.discard()


def test_a_frame_that_is_cut_short_while_it_is_used_is_one_line(tmp_path):
    spool = Spool(tmp_path / "bake.usdc", "a")
    spool.write(0, 1.0, np.ones((10, 3)))
    with open(spool._path(0, 1.0), "r+b") as file:
        file.truncate(5 * 12)
    assert read(spool, 1.0, slice(0, 5)).all()
    for rows in (slice(0, 10), slice(5, 10), slice(8, 10)):
        with pytest.raises(NeuralocksError, match="cannot be read .*; bake again"):
            read(spool, 1.0, rows)
    spool.discard()


def test_a_frame_is_written_over_one_that_nothing_needs_any_more(tmp_path):
    """Also over a longer frame, of another groom."""
    spool = Spool(tmp_path / "bake.usdc", "a")
    spool.write(0, 1.0, np.ones((50, 3)))
    for code in (1.0, 2.0):
        spool.forget(0, code)
        assert not spool.holds(0, code, 50)
    spool.write(1, 1.0, np.full((9, 3), 2.0))
    assert not list(spool.folder.glob("*.part"))
    spool.write(0, 3.0, np.ones((50, 3)))
    spool.forget(0, 3.0)
    spool.close()
    assert not list(spool.folder.glob("*.part"))  # a stopped bake leaves only files to resume from
    again = Spool(tmp_path / "bake.usdc", "a")
    assert again.holds(1, 1.0, 9) and (read(again, 1.0, slice(0, 9), batch=1) == 2).all()
    again.discard()


def test_folders_and_links_in_the_place_of_frames_make_way(tmp_path):
    folder = tmp_path / ".bake.usdc.baking"
    spool = Spool(tmp_path / "bake.usdc", "a")
    spool.write(0, 3.0, np.ones((2, 3)))
    spool.close()
    (tmp_path / "mine").write_text("mine")
    (folder / "0_0x1.0000000000000p+0.frame" / "deep").mkdir(parents=True)
    (folder / "0_0x1.0000000000000p+1.frame").symlink_to(tmp_path / "mine")
    (folder / "notes.frame").touch()
    spool = Spool(tmp_path / "bake.usdc", "a")
    for code in (1.0, 2.0):
        spool.write(0, code, np.zeros((2, 3)))
    assert all(spool.holds(0, code, 2) for code in (1.0, 2.0, 3.0)) and (folder / "notes.frame").exists()
    spool.close()
    (folder / "inputs").unlink()
    (folder / "inputs").mkdir()
    spool = Spool(tmp_path / "bake.usdc", "a")
    assert not spool.holds(0, 3.0, 2) and (tmp_path / "mine").read_text() == "mine"
    spool.discard()


def test_a_link_in_the_place_of_the_folder_is_refused(tmp_path):
    """Files with our names behind it may be somebody else's."""
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    (theirs / "0_0x1p+0.frame").write_text("precious")
    (tmp_path / ".bake.usdc.baking").symlink_to(theirs)
    with pytest.raises(NeuralocksError, match=r"\.bake\.usdc\.baking: is a link, .*; remove the link$"):
        Spool(tmp_path / "bake.usdc", "a")
    assert [path.name for path in theirs.iterdir()] == ["0_0x1p+0.frame"]


def test_a_disk_without_room_for_a_mark_is_left_as_it_was(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(NeuralocksError, match="no space left"):
        Spool(tmp_path / "bake.usdc", "a")
    assert not list(tmp_path.iterdir())


def test_the_folder_is_locked_until_it_is_gone(tmp_path, monkeypatch):
    pytest.importorskip("fcntl")
    spool, removed = Spool(tmp_path / "bake.usdc", "a"), []

    def checked(path):
        with pytest.raises(NeuralocksError, match="another bake"):
            Spool(tmp_path / "bake.usdc", "b")
        removed.append(path.name)
        _remove(path)

    spool.write(0, 1.0, np.zeros((2, 3)))
    monkeypatch.setattr("usd.baking.layer.spool._remove", checked)
    spool.discard()
    assert len(removed) == 2 and not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", ["close", "discard"])
def test_a_bake_that_fails_once_it_let_go_of_the_folder_leaves_it_to_the_next(tmp_path, ending):
    done = Spool(tmp_path / "bake.usdc", "a")
    done.layer_path.write_bytes(b"layer")
    done.finish()
    following = Spool(tmp_path / "bake.usdc", "a")
    following.write(0, 1.0, np.ones((2, 3)))
    getattr(done, ending)()
    assert read(following, 1.0, slice(0, 2)).all() and (following.folder / "lock").exists()
    following.discard()
    assert [path.name for path in tmp_path.iterdir()] == ["bake.usdc"]


@pytest.mark.parametrize("ending", ["finish", "close", "discard"])
def test_what_a_user_put_into_the_folder_stays(tmp_path, ending):
    folder = tmp_path / ".bake.usdc.baking"
    spool = Spool(tmp_path / "bake.usdc", "a")
    (folder / "notes.txt").write_text("mine")
    (folder / "mine").mkdir()
    spool.layer_path.write_bytes(b"layer")
    if ending == "finish":
        spool.write(0, 1.0, np.zeros((2, 3)))
    getattr(spool, ending)()
    assert sorted(path.name for path in folder.iterdir()) == ["mine", "notes.txt"]
    assert (tmp_path / "bake.usdc").exists() == (ending == "finish")


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


def test_frames_that_a_bake_of_others_left_make_way(tmp_path):
    spool = Spool(tmp_path / "bake.usdc", "a")
    for code in (1.0, 2.0):
        spool.write(0, code, np.ones((2, 3)))
    spool.keep_only([(0, 2.0), (0, 3.0), (1, 1.0)])
    assert [spool.holds(0, code, 2) for code in (1.0, 2.0)] == [False, True]
    spool.discard()


def test_a_folder_made_for_an_output_that_did_not_come_is_gone(tmp_path):
    Spool(tmp_path / "new" / "bake.usdc", "a").close()
    assert not list(tmp_path.iterdir())


def test_a_shot_edited_at_the_same_size_is_another_one(tmp_path):
    """A bake must not resume from frames of the shot as it was before."""
    shot = tmp_path / "shot.usda"
    shot.write_text("a = 1")
    os.utime(shot, ns=(10**18, 10**18))
    before = fingerprint([shot], {})
    assert fingerprint([shot], {}) == before
    shot.write_text("a = 2")
    os.utime(shot, ns=(10**18, 10**18 + 10**6))
    assert fingerprint([shot], {}) != before


def test_a_write_protected_output_is_refused_before_any_frame(tmp_path):
    out = tmp_path / "hair.usdc"
    out.write_bytes(b"published")
    out.chmod(0o444)
    with pytest.raises(CannotWrite, match="hair.usdc: is write-protected; make it writable"):
        Spool(out, "x")
    assert list(tmp_path.iterdir()) == [out] and out.read_bytes() == b"published"


def test_all_files_of_the_program_tell_its_version():
    root = Path(__file__).parents[3]
    found = {file.relative_to(root).as_posix() for file in program_files()}
    assert found >= {"usd/__init__.py", "usd/shot/carriers/seat.py", "neuralocks_core/deformation/clumping.py"}
