# SPDX-License-Identifier: Apache-2.0
"""A model unpacked for other runtimes: all of its files or none."""

import errno
from pathlib import Path

import pytest

from neuralocks_core.errors import NeuralocksError
from usd.export import export_model

from .shots import write_shot


def test_a_full_disk_leaves_no_half_of_an_export(tmp_path, model, monkeypatch):
    shot = write_shot(tmp_path)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(NeuralocksError, match="no space left"):
        export_model(model, tmp_path / "onnx", shot)
    assert list(tmp_path.iterdir()) == [shot]
