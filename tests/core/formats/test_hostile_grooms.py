# SPDX-License-Identifier: Apache-2.0
"""Hostile groom files get one clear error, and no more memory than their size can justify."""

import bz2
import gzip
import lzma
import struct
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from neuralocks_core import formats
from neuralocks_core.errors import NeuralocksError
from tests.core.formats.groom_files import FILES, counted, put


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("grooms")


def _huge(at, values, name):
    content = bytearray(FILES[name])
    content[at : at + 4 * len(values)] = struct.pack(f"<{len(values)}I", *values)
    return content


HOSTILE = {
    "empty.tfx": b"",
    "empty.hair": b"HAIR",
    "empty.data": b"",
    "none.data": struct.pack("<i", 0),
    "negative.data": struct.pack("<ii", 1, -5),
    "minus.data": struct.pack("<ii", -1, 3),
    "terabytes.tfx": _huge(4, [2**32 - 1, 2**32 - 1], "v4.tfx"),
    "terabytes3.tfx": _huge(4, [2**31, 2**31], "v3.tfx"),
    "offset.tfx": _huge(12, [2**32 - 16], "v4.tfx"),
    "header.tfx": _huge(12, [8], "v4.tfx"),
    "uv.tfx": _huge(16, [2**32 - 8], "v4.tfx"),
    "terabytes.hair": _huge(4, [2**32 - 1, 2**32 - 1], "a.hair"),
    "default.hair": struct.pack("<4sIIIIfffff88s", b"HAIR", 2**31, 2**32 - 1, 2, 2**31, 0, 0, 0, 0, 0, b""),
    "terabytes.data": struct.pack("<iii", 2**31 - 1, 2**31 - 1, 0),
    "terabytes.bin": struct.pack("<iii", 1, 2**31 - 1, 0),
    "text.tfx": b"version 2.0\nis sorted 1\nstrand 0 numVerts 999999999 texcoord 0 0\n0 0 0\n",
    "pointless.tfx": b"version 2.0\nis sorted 1\nstrand 0 numVerts 0 texcoord 0 0\n",
    "words.tfx": b"version 2.0\nis sorted 1\nstrand 0 numVerts 2\n0 0 0\nhair nan 1\n",
    "nan.tfx": b"version 2.0\nis sorted 1\nstrand 0 numVerts 2\n0 0 0\n0 nan 1\n",
    "nostrand.tfx": b"version 2.0\nis sorted 1\n",
    "header2.tfx": b"version 2.0\n" + b"a 1\n" * 5000,
    "scale.tfx": b"version 2.0\nscale 1e38\nis sorted 1\nstrand 0 numVerts 2\n0 0 0\n0 90 0\n",
    "unknown.xyz": b"hello",
    "nan.data": counted(3)[:8] + struct.pack("<f", np.nan) + counted(3)[12:],
    "far.data": counted(3)[:8] + struct.pack("<f", 3e38) + counted(3)[12:],
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_get_one_line(folder, name):
    path = put(folder, name, HOSTILE[name])
    with pytest.raises(NeuralocksError) as error:
        formats.read(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert "; " in message
    assert "\n" not in message


@pytest.mark.parametrize("name", ["a.data", "a.bin"])
def test_big_endian_files_are_called_so(folder, name):
    content = np.frombuffer(FILES[name], "<i4").byteswap().tobytes()
    with pytest.raises(NeuralocksError, match="big-endian"):
        formats.read(put(folder, name, content))


@pytest.mark.parametrize("name", ["a.hair", "colors.hair", "v3.tfx", "v4.tfx"])
def test_headers_of_the_other_byte_order_are_called_so(folder, name):
    """Their numbers are four bytes each, up to the text in `.hair` files."""
    magic = 4 if name.endswith(".hair") else 0
    words = np.frombuffer(FILES[name][magic:40], "<i4").byteswap().tobytes()
    with pytest.raises(NeuralocksError, match="is written big-endian.*little-endian"):
        formats.read(put(folder, name, FILES[name][:magic] + words + FILES[name][40:]))


@pytest.mark.parametrize("name", [*FILES, "a.hair.gz", "groom"])
@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress, lzma.compress])
def test_packed_files_are_called_so(folder, name, pack):
    content = pack(FILES.get(name, FILES["a.hair"]))
    with pytest.raises(NeuralocksError, match=r"is packed \((gzip|bzip2|xz)\); unpack it first"):
        formats.read(put(folder, name, content))


@pytest.mark.parametrize("name", ["hair.neuralocks", "arrays.npz", "hair.docx"])
def test_what_is_packed_and_no_groom_is_not_to_be_unpacked(folder, name):
    """A model, for example, is a zip."""
    with pytest.raises(NeuralocksError, match="is not a known groom file, by content or by name; give .tfx"):
        formats.read(put(folder, name, b"PK\x03\x04" + bytes(100)))


@pytest.mark.parametrize("name", FILES)
def test_every_truncation_is_noticed(folder, name):
    content = FILES[name]
    if name.startswith("text"):
        # Within a line a number may just be shorter.
        cuts = [at for at, character in enumerate(content) if character == ord("\n")][6:]
    else:
        cuts = range(len(content))
    for cut in cuts:
        with pytest.raises(NeuralocksError):
            formats.read(put(folder, name, content[:cut]))


def test_missing_folder_and_bad_arguments(folder):
    path = put(folder, "a.data", FILES["a.data"])
    for call in (
        lambda: formats.read(folder / "missing.tfx"),
        lambda: formats.read(folder),
        lambda: formats.read(path, unit="parsec"),
        lambda: formats.read(path, unit=0),
        lambda: formats.read(path, unit=float("nan")),
        lambda: formats.read(path, up="X"),
        lambda: formats.read("nul\0byte.tfx"),
    ):
        with pytest.raises(NeuralocksError, match="; "):
            call()


def _read_bounded(folder, name, content):
    """Reading either works or raises the error for users, and allocates no more than the file can justify."""
    path = put(folder, name, bytes(content))
    tracemalloc.start()
    try:
        formats.read(path)
    except NeuralocksError:
        pass
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < 60 * len(content) + 300_000


@given(name=st.sampled_from(["x.tfx", "x.hair", "x.data", "x.bin", "x.foo"]), content=st.binary(max_size=400))
@settings(max_examples=300, deadline=None)
def test_arbitrary_bytes(folder, name, content):
    _read_bounded(folder, name, content)


@given(
    name=st.sampled_from(list(FILES)),
    edits=st.lists(st.tuples(st.integers(0, 10_000), st.binary(min_size=1, max_size=4)), min_size=1, max_size=4),
    keep=st.integers(1, 400),
)
@settings(max_examples=400, deadline=None)
def test_mutated_files(folder, name, edits, keep):
    content = bytearray(FILES[name])
    for at, patch in edits:
        at %= len(content)
        content[at : at + len(patch)] = patch
    _read_bounded(folder, name, content[: max(8, len(content) * keep // 300)])
