# SPDX-License-Identifier: Apache-2.0
"""Where no library fits, there is none, without an error."""

import platform

import pytest

from neuralocks_core.native import library as module
from neuralocks_core.native.library import library


@pytest.fixture(autouse=True)
def afresh():
    library.cache_clear()
    yield
    library.cache_clear()


def test_an_unknown_machine_has_none(monkeypatch):
    monkeypatch.setattr(platform, "machine", lambda: "riscv64")
    assert library() is None


def test_a_missing_or_damaged_file_is_none(monkeypatch, tmp_path):
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    assert library() is None
    for system, machine in (
        ("linux", "x64"),
        ("linux", "arm64"),
        ("macos", "arm64"),
        ("macos", "x64"),
        ("windows", "x64"),
    ):
        module.file_for(f"{system}-{machine}").write_bytes(b"not a library")
    library.cache_clear()
    assert library() is None


def test_a_library_of_another_version_is_none(monkeypatch):
    monkeypatch.setattr(module, "LAYOUT", module.LAYOUT + 1)
    assert library() is None
