# SPDX-License-Identifier: Apache-2.0
"""The compiled libraries in the repository are those of the sources beside them."""

import re

import numpy as np
import pytest

from neuralocks_core.body import moving_skin, near_body
from neuralocks_core.deformation import laying, lengths, spans
from neuralocks_core.models.network_sizes import K
from neuralocks_core.native import build, library
from neuralocks_core.native.body import MOST_NEIGHBOURS, VERTICES
from neuralocks_core.native.library import FOLDER, file_for

BEGIN = {"linux": b"\x7fELF", "windows": b"MZ", "macos": b"\xcf\xfa\xed\xfe"}


@pytest.fixture
def compiler():
    made = pytest.importorskip("ziglang", reason="the compiler is not installed") and build.made()
    recorded = build.MADE.read_text(encoding="utf-8")
    if made.split("\n")[0] != recorded.split("\n")[0]:
        pytest.skip(f"the libraries are of {recorded.split()[1]}, not of {made.split()[1]}")
    return made


def test_the_libraries_are_of_these_sources(compiler):
    """`make native` after a change."""
    assert build.MADE.read_text(encoding="utf-8") == compiler
    assert {file.name for file in FOLDER.iterdir()} == {file_for(t).name for t in build.TARGETS} | {build.MADE.name}


def test_anyone_who_compiles_the_sources_gets_the_same_bytes(compiler, tmp_path, monkeypatch):
    for kind in ("GLOBAL", "LOCAL"):
        monkeypatch.setenv(f"ZIG_{kind}_CACHE_DIR", str(tmp_path / kind))
    made = build.build("linux-x64", tmp_path / file_for("linux-x64").name)
    assert made.read_bytes() == file_for("linux-x64").read_bytes()


@pytest.mark.parametrize("target", build.TARGETS)
def test_each_is_a_library_for_its_system_with_all_functions(target):
    held = file_for(target).read_bytes()
    assert held.startswith(BEGIN[target.split("-")[0]]) and len(held) < 200_000
    assert all(f"neuralocks_{name}\0".encode() in held for name in ("layout", "keep_out", "lay", "pose_skin", "carry"))


NUMBERS = {
    moving_skin: ("REACH", "BESIDE", "THIN", "DEPTH", "SKIN"),
    near_body: ("HEAD", "CURVED"),
    laying: ("SLACK", "MARGIN", "FLAT", "BACK", "UNSEEN", "STEEP", "TRIES", "NEVER", "ALWAYS"),
    lengths: ("TINY",),
    spans: ("NODES",),
    library: ("LAYOUT",),
}


@pytest.mark.parametrize("module", NUMBERS)
def test_numbers_in_c_are_those_in_python(module):
    sources = "".join(file.read_text(encoding="utf-8") for file in build.SOURCES)
    for name in NUMBERS[module]:
        (given,) = re.findall(rf"\b{name} = ([-\d.e]+)", sources)
        assert np.float32(given) == np.float32(getattr(module, name)), name


def test_sizes_of_arrays_in_c_hold_strands_and_neighbours():
    sources = "".join(file.read_text(encoding="utf-8") for file in build.SOURCES)
    given = [int(re.search(rf"\b{name} = (\d+)", sources)[1]) for name in ("K", "MOST_NEAR")]
    assert given == [VERTICES, MOST_NEIGHBOURS] == [K, moving_skin.NEIGHBOURS]
