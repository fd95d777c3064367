# SPDX-License-Identifier: Apache-2.0
"""Where libraries keep what they compile for a user without a home folder."""

import os
import stat
import tempfile
from types import SimpleNamespace

import pytest

from neuralocks_core.cache_folder import cache_folder, writable
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.warp_device import _init

posix = pytest.mark.skipif(os.name != "posix", reason="has neither users nor modes")


@posix
def test_the_folder_is_its_users_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = cache_folder("warp")
    assert writable(folder) and cache_folder("warp") == folder
    assert stat.S_IMODE(folder.parent.stat().st_mode) == 0o700


@posix
@pytest.mark.parametrize("kind", ["open to all", "link", "file"])
def test_a_folder_that_another_user_prepared_is_refused(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    mine = tmp_path / f"neuralocks-{os.getuid()}"
    if kind == "link":
        (tmp_path / "theirs").mkdir(mode=0o700)
        mine.symlink_to("theirs")
    elif kind == "file":
        mine.touch()
    else:
        mine.mkdir()
        mine.chmod(0o777)
    with pytest.raises(NeuralocksError, match="TMPDIR"):
        cache_folder("warp")


def test_warp_compiles_elsewhere_where_it_cannot_make_its_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def init():
        if wp.config.kernel_cache_dir is None:
            raise PermissionError(13, "Permission denied", "/home/.cache")

    wp = SimpleNamespace(config=SimpleNamespace(kernel_cache_dir=None, version="1"), init=init)
    _init(wp)
    assert wp.config.kernel_cache_dir.startswith(str(tmp_path))
    (tmp_path / "file").touch()
    wp.config.kernel_cache_dir = str(tmp_path / "file" / "cache")
    _init(wp)
    assert "neuralocks-" in wp.config.kernel_cache_dir
