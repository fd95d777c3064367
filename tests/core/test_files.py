# SPDX-License-Identifier: Apache-2.0
"""A file is whole or not there, whatever happens while it is written."""

import errno

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.files import atomic_write, replace_npz
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


def test_arrays_that_find_no_room_leave_those_that_were_there(tmp_path):
    path = tmp_path / "a.npz"
    replace_npz(path, {"few": np.arange(3)})
    with pytest.raises(NeuralocksError, match="a.npz: no space"), room_for(10_000):
        replace_npz(path, {"many": np.zeros(10_000)})
    assert np.load(path)["few"].size == 3 and list(tmp_path.iterdir()) == [path]
