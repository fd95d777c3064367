# SPDX-License-Identifier: Apache-2.0
"""Every groom format reads what it holds, real files import, and hostile files get one clear error."""

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from neuralocks_core import formats
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats import cemyuksel
from neuralocks_core.groom import Groom
from neuralocks_core.strands import strand_set

DATA = Path(__file__).parents[4] / "shared" / "data" / "grooms"
COUNTS = [4, 1, 3]
POINTS = np.random.default_rng(0).normal(size=(8, 3)).astype("<f4") * 0.1


def tressfx_text(points=POINTS, counts=COUNTS):
    lines = ["version 2.0", "scale 1.0", "rotation 0 0 0", "translation 0 0 0", "numStrands 3", "is sorted 1"]
    at = 0
    for strand, n in enumerate(counts):
        lines.append(f"strand {strand} numVerts {n} texcoord 0.25 0.{strand}00000")
        lines += [" ".join(f"{float(v)!r}" for v in p) for p in points[at : at + n]]
        at += n
    return "\n".join(lines).encode()


def tressfx_v3():
    header = struct.pack("<fII", 3.0, 2, 4).ljust(144, b"\0") + struct.pack("<I", 296)
    return header.ljust(296, b"\0") + POINTS.tobytes()


def tressfx_v4():
    header = struct.pack("<fIIIIII", 4.0, 2, 4, 160, 160 + 128, 0, 160 + 144).ljust(160, b"\0")
    uv = np.array([[0.1, 0.2], [0.3, 0.4]], "<f4")
    width = np.array([1e-4, 2e-4], "<f4")
    return header + np.c_[POINTS, np.ones(8, "<f4")].astype("<f4").tobytes() + uv.tobytes() + width.tobytes()


def hair():
    header = struct.pack("<4sIIIIfffff88s", b"HAIR", 3, 8, 3, 0, 1e-4, 0, 0, 0, 0, b"")
    return header + np.array([3, 0, 2], "<u2").tobytes() + POINTS.tobytes()


def counted(columns):
    parts, at = [struct.pack("<i", 3)], 0
    for n in COUNTS:
        rows = np.zeros((n, columns), "<f4")
        rows[:, :3] = POINTS[at : at + n]
        parts += [struct.pack("<i", n), rows.tobytes()]
        at += n
    return b"".join(parts)


FILES = {
    "text.tfx": tressfx_text(),
    "v3.tfx": tressfx_v3(),
    "v4.tfx": tressfx_v4(),
    "a.hair": hair(),
    "a.data": counted(3),
    "a.bin": counted(7),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("grooms")


def put(folder, name, content):
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("name", FILES)
def test_points_counts_unit_and_axis(folder, name):
    groom = formats.read(put(folder, name, FILES[name]), unit="cm", up="Z")
    expected = (POINTS * np.float32(0.01))[:, [0, 2, 1]] * [1, 1, -1]
    np.testing.assert_allclose(groom.points, expected, rtol=1e-6)
    np.testing.assert_array_equal(groom.counts, [4, 4] if name[0] == "v" else COUNTS)
    assert groom.name == Path(name).stem


def test_what_else_the_files_hold(folder):
    text = formats.read(put(folder, "text.tfx", FILES["text.tfx"]))
    np.testing.assert_allclose(text.root_uv, [[0.25, 0.0], [0.25, 0.1], [0.25, 0.2]], rtol=1e-6)
    v4 = formats.read(put(folder, "v4.tfx", FILES["v4.tfx"]), unit="m")
    np.testing.assert_allclose(v4.root_uv, [[0.1, 0.2], [0.3, 0.4]], rtol=1e-6)
    np.testing.assert_allclose(v4.widths, [1e-4, 2e-4], rtol=1e-6)


def test_strands_without_length_are_reported(folder):
    _, notes = formats.read_with_notes(put(folder, "a.data", FILES["a.data"]))
    assert notes == [
        f"{folder / 'a.data'}: 1 of 3 strands have no two distinct points; they are kept, but will not "
        "move on their own"
    ]


def test_units_of_the_formats(folder):
    assert np.ptp(formats.read(put(folder, "a.data", FILES["a.data"])).points) == pytest.approx(np.ptp(POINTS))
    assert np.ptp(formats.read(put(folder, "a.bin", FILES["a.bin"])).points) == pytest.approx(np.ptp(POINTS) / 1000)
    for unit in (1.0, 0.01, 0.001):  # a scalp 20 cm wide in any unit
        scaled = tressfx_text(POINTS / np.ptp(POINTS) * 0.2 / unit)
        groom, notes = formats.read_with_notes(put(folder, "text.tfx", scaled))
        assert np.ptp(groom.points) == pytest.approx(0.2, rel=1e-4)
        assert "does not state its unit" in notes[0]


def test_transform_of_the_text_format(folder):
    content = FILES["text.tfx"].replace(
        b"scale 1.0\nrotation 0 0 0\ntranslation 0 0 0", b"scale 2.0\nrotation 0 0 90\ntranslation 1 0 0"
    )
    moved = formats.read(put(folder, "text.tfx", content), unit="m")
    np.testing.assert_allclose(moved.points, 2 * POINTS[:, [1, 0, 2]] * [-1, 1, 1] + [1, 0, 0], atol=1e-6)


@given(
    counts=st.lists(st.integers(1, 9), min_size=1, max_size=20),
    each=st.booleans(),
    unit=st.sampled_from([1.0, 0.01, 0.001]),
    up=st.sampled_from("YZ"),
)
@settings(max_examples=30, deadline=None)
def test_hair_round_trip(folder, counts, each, unit, up):
    random = np.random.default_rng(0)
    total = sum(counts)
    widths = random.uniform(5e-5, 1e-4, total if each else 1)
    groom = Groom("g", random.normal(size=(total, 3)) * 0.1, counts, widths)
    cemyuksel.write(folder / "g.hair", groom, unit, up)
    back = formats.read(folder / "g.hair", unit, up)
    np.testing.assert_array_equal(back.counts, groom.counts)
    np.testing.assert_allclose(back.points, groom.points, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(back.widths, groom.widths, rtol=1e-5)
    assert [p.name for p in folder.glob(".*")] == []  # no scratch file left


def test_thickness_that_is_no_number_is_left_out(folder):
    """A signalling NaN, of which numpy warns when it is multiplied."""
    groom = Groom("a", np.random.default_rng(0).normal(0, 0.1, (6, 3)), [3, 3], np.full(6, 1e-4))
    cemyuksel.write(folder / "bad.hair", groom)
    content = bytearray((folder / "bad.hair").read_bytes())
    content[-4:] = b"\x01\x00\xa0\x7f"
    (folder / "bad.hair").write_bytes(content)
    read, notes = formats.read_with_notes(folder / "bad.hair", unit="cm")
    assert read.widths == np.float32(8e-5) and any("thickness" in note for note in notes)


def test_hair_refuses_what_it_cannot_hold(folder):
    with pytest.raises(NeuralocksError, match="1 to 65536"):
        cemyuksel.write(folder / "g.hair", Groom("g", POINTS, [8, 0]))
    with pytest.raises(NeuralocksError, match="cannot be written"):
        cemyuksel.write(Path(__file__) / "g.hair", Groom("g", POINTS, [8]))


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
    "words.tfx": b"version 2.0\nis sorted 1\nstrand 0 numVerts 2\n0 0 0\nhair nan 1\n",
    "nan.tfx": b"version 2.0\nis sorted 1\nstrand 0 numVerts 2\n0 0 0\n0 nan 1\n",
    "nostrand.tfx": b"version 2.0\nis sorted 1\n",
    "header2.tfx": b"version 2.0\n" + b"a 1\n" * 5000,
    "unknown.xyz": b"hello",
    "nan.data": counted(3)[:8] + struct.pack("<f", np.nan) + counted(3)[12:],
    "far.data": counted(3)[:8] + struct.pack("<f", 3e38) + counted(3)[12:],
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_get_one_line(folder, name):
    path = put(folder, name, HOSTILE[name])
    with pytest.raises(NeuralocksError) as error:
        formats.read(path)
    message = str(error.value)
    assert message.startswith(f"{path}: ")
    assert "; " in message
    assert "\n" not in message


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
    """Reading either works or raises the users' error, and allocates no more than the file can justify."""
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


REAL = {
    "sintel/sintel_hair.tfx": (11400, 16),
    "ruby/ruby_long_hair.tfx": (3000, 16),
    "ruby/ruby_short_hair.tfx": (1867, 16),
    "ponytail/hair_free.tfx": (3942, 16),
    "ponytail/hair_front.tfx": (93, 16),
    "ponytail/hair_pulled.tfx": (517, 16),
    "ponytail/hair_tail.tfx": (474, 16),
    "ponytail/ponytail_tail_v3.tfx": (474, 16),
    "mohawk/ratboy_mohawk.tfx": (2228, 32),
    "fur/testhair1.tfx": (10027, 4),
}


@pytest.mark.skipif(not DATA.exists(), reason="real grooms are not beside the repository")
@pytest.mark.parametrize("name", REAL)
def test_real_files_import(name):
    """All strands arrive, those of no length are told apart, and the network's view of them is finite."""
    groom = formats.read(DATA / name)
    strands, vertices = REAL[name]
    assert groom.strand_count == strands
    assert (groom.counts == vertices).all()
    seen = strand_set(groom, np.zeros(3), groom.points.mean(axis=0))
    own = groom.points.reshape(strands, vertices, 3)
    still = (own == own[:, :1]).all(axis=(1, 2))
    assert not seen.valid[still].any()
    assert seen.valid[np.linalg.norm(np.diff(own, axis=1), axis=2).sum(axis=1) > 1e-4].all()
    assert all(np.isfinite(a).all() for a in (seen.rest, seen.uv, seen.root_frame, seen.length))


@pytest.mark.skipif(not DATA.exists(), reason="real grooms are not beside the repository")
def test_two_versions_of_one_tail_agree():
    """The binary v3 ponytail is the text v2 one with Z flipped, in another order and partly combed anew."""
    text = formats.read(DATA / "ponytail/hair_tail.tfx", unit=0.003).points.reshape(474, 16, 3)
    binary = formats.read(DATA / "ponytail/ponytail_tail_v3.tfx", unit=0.003).points.reshape(474, 16, 3)
    binary = binary * [1, 1, -1]
    assert cKDTree(text[:, 0]).query(binary[:, 0])[0].max() < 1e-6
    assert np.median(cKDTree(text.reshape(474, -1)).query(binary.reshape(474, -1))[0]) < 1e-6
