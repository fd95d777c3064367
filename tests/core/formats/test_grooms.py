# SPDX-License-Identifier: Apache-2.0
"""Every groom format reads what it holds, and real files import."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from neuralocks_core import formats
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats.look import Look
from neuralocks_core.formats.units import UNITS
from neuralocks_core.groom import Groom
from neuralocks_core.strands.strand_set import strand_set
from tests.core.formats.groom_files import COUNTS, FILES, POINTS, counted, put, tressfx_text, write_hair
from tests.shared_data import SHARED

DATA = SHARED / "grooms"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("grooms")


@pytest.mark.parametrize("name", FILES)
def test_points_counts_unit_and_axis(folder, name):
    groom = formats.read(put(folder, name, FILES[name]), unit="cm", up="Z")
    expected = (POINTS * np.float32(0.01))[:, [0, 2, 1]] * [1, 1, -1]
    np.testing.assert_allclose(groom.points, expected, rtol=1e-6)
    np.testing.assert_array_equal(groom.counts, [4, 4] if name[0] == "v" else COUNTS)
    assert groom.name == Path(name).stem


def test_hair_files_are_z_up_where_nothing_else_is_said(folder):
    groom = formats.read(put(folder, "a.hair", FILES["a.hair"]), unit="m")
    np.testing.assert_allclose(groom.points, POINTS[:, [0, 2, 1]] * [1, 1, -1], rtol=1e-6)


def test_what_else_the_files_hold(folder):
    text = formats.read(put(folder, "text.tfx", FILES["text.tfx"]))
    np.testing.assert_allclose(text.root_uv, [[0.25, 0.0], [0.25, 0.1], [0.25, 0.2]], rtol=1e-6)
    v4 = formats.read(put(folder, "v4.tfx", FILES["v4.tfx"]), unit="m")
    np.testing.assert_allclose(v4.root_uv, [[0.1, 0.2], [0.3, 0.4]], rtol=1e-6)
    np.testing.assert_allclose(v4.widths, [1e-4, 2e-4], rtol=1e-6)


def test_tressfx_text_may_have_commas_between_coordinates(folder):
    lines = FILES["text.tfx"].decode().splitlines()

    def edited(old, new):
        changed = [line.replace(old, new) if line[0] in "-0123456789" else line for line in lines]
        return put(folder, "commas.tfx", "\n".join(changed).encode())

    plain = formats.read(put(folder, "text.tfx", FILES["text.tfx"]), "cm")
    np.testing.assert_array_equal(formats.read(edited(" ", ", "), "cm").points, plain.points)
    with pytest.raises(NeuralocksError, match="line 8 is not x y z"):  # a decimal comma
        formats.read(edited(".", ","), "cm")


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


@pytest.mark.parametrize(
    "unit, words", [("m", ""), ("cm", "36 m of hair; import --unit cm?"), ("mm", "360 m of hair; import --unit mm?")]
)
def test_hair_that_its_formats_unit_makes_too_large_is_told(folder, unit, words):
    points = POINTS / np.ptp(POINTS, axis=0).max() * np.float32(0.36 / UNITS[unit])
    path = put(folder, "large.data", counted(3, points))
    groom, notes = formats.read_with_notes(path)
    told = [note for note in notes if "--unit" in note]
    assert told == ([f"{path}: its format counts in m, which makes it {words}"] if words else [])
    np.testing.assert_array_equal(groom.points, points)
    assert not any("--unit" in note for note in formats.read_with_notes(path, unit)[1])


@pytest.mark.parametrize(
    "metres, words",
    [
        (0.01, "took 1 cm, by which the scalp is 17 cm wide; import --unit"),
        (0.0254, "took 1 cm, by which the scalp is 6.69 cm wide, narrow; in inches 17 cm; import --unit"),
        (0.003, "took 1 mm, by which the scalp is 5.67 cm wide, narrow; import --unit"),
        (0.3048, "took 1 m, by which the scalp is 55.8 cm wide, more than a head; import --unit"),
        (0.1, "took 1 cm, by which the scalp is 1.7 cm wide, narrow; in inches 4.32 cm; import --unit"),
    ],
)
def test_the_scalps_width_is_told_where_no_unit_is_stated(folder, metres, words):
    points = np.zeros((51, 2, 3))
    points[..., 0] = np.linspace(0, 0.17 / 0.96 / metres, 51)[:, None]  # all but the outermost roots count
    points[:, 1, 1] = -0.2 / metres
    content = tressfx_text(points.reshape(-1, 3), [2] * 51)
    (note,) = formats.read_with_notes(put(folder, "scalp.tfx", content))[1]
    assert words in note


def test_the_text_format_may_begin_with_a_mark_and_hold_comments(folder):
    lines = (
        FILES["text.tfx"]
        .replace(b"numStrands", b"# strands follow\nnumStrands")
        .replace(b"sorted 1\n", b"sorted 1\n# here\n")
    )
    for beginning in (b"\xef\xbb\xbf", b"# made by hand\n\n", b"\xef\xbb\xbf# both\r\n"):
        groom = formats.read(put(folder, "text.tfx", beginning + lines), unit="m")
        np.testing.assert_allclose(groom.points, POINTS, atol=1e-6)


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
    write_hair(folder / "g.hair", groom, unit, up)
    back = formats.read(folder / "g.hair", unit, up)
    np.testing.assert_array_equal(back.counts, groom.counts)
    np.testing.assert_allclose(back.points, groom.points, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(back.widths, groom.widths, rtol=1e-5)


@given(
    counts=st.lists(st.integers(2, 5), min_size=1, max_size=6),
    colors=st.sampled_from(["none", "one", "each"]),
    clear=st.sampled_from(["none", "one", "each"]),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=30, deadline=None)
def test_colors_round_trip(folder, counts, colors, clear, seed):
    random, rows = np.random.default_rng(seed), {"one": 1, "each": sum(counts)}
    color = None if colors == "none" else random.uniform(0.01, 1, (rows[colors], 3)).astype(np.float32)
    opacity = None if clear == "none" else random.uniform(0, 0.99, rows[clear]).astype(np.float32)
    groom = Groom("g", random.normal(size=(sum(counts), 3)) * 0.1, counts)
    write_hair(folder / "look.hair", groom, look=Look(color, opacity))
    _, look, notes = formats.read_with_look(folder / "look.hair", "cm")
    assert not notes
    for back, written in ((look.color, color), (look.opacity, opacity)):
        assert (back is None) == (written is None)
        if written is not None:
            assert back.shape == written.shape and back.dtype == np.float32
            np.testing.assert_allclose(back, written, atol=1e-7)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -0.1, 1.5, 255.0])
@pytest.mark.parametrize(("at", "what"), [(-4, "colours"), (-4 - 12 * 8, "transparencies")])
def test_colors_that_are_none_are_left_out(folder, bad, at, what):
    content = bytearray(FILES["colors.hair"])
    content[at : at + 4 if at + 4 else None] = np.float32(bad).tobytes()
    groom, look, notes = formats.read_with_look(put(folder, "bad.hair", content), "cm")
    assert len(groom.points) == 8 and (look.color is None, look.opacity is None) == (
        what == "colours",
        what != "colours",
    )
    assert [note for note in notes if f"its {what} are not all from 0 to 1; left out" in note]


def test_a_header_that_was_left_at_zero_says_no_color(folder):
    _, look, _ = formats.read_with_look(put(folder, "a.hair", FILES["a.hair"]))
    assert look.color is None and look.opacity is None


def test_thickness_that_is_no_number_is_left_out(folder):
    """A signalling NaN, about which numpy warns when it is multiplied."""
    groom = Groom("a", np.random.default_rng(0).normal(0, 0.1, (6, 3)), [3, 3], np.full(6, 1e-4))
    write_hair(folder / "bad.hair", groom)
    content = bytearray((folder / "bad.hair").read_bytes())
    content[-4:] = b"\x01\x00\xa0\x7f"
    (folder / "bad.hair").write_bytes(content)
    read, notes = formats.read_with_notes(folder / "bad.hair", unit="cm")
    assert read.widths == np.float32(8e-5) and any("thickness" in note for note in notes)


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
    """All strands arrive, those without length are recognised, and the network's view of them is finite."""
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
    """The binary v3 ponytail is the text v2 one with Z flipped, in another order and partly recombed."""
    text = formats.read(DATA / "ponytail/hair_tail.tfx", unit=0.003).points.reshape(474, 16, 3)
    binary = formats.read(DATA / "ponytail/ponytail_tail_v3.tfx", unit=0.003).points.reshape(474, 16, 3)
    binary = binary * [1, 1, -1]
    assert cKDTree(text[:, 0]).query(binary[:, 0])[0].max() < 1e-6
    assert np.median(cKDTree(text.reshape(474, -1)).query(binary.reshape(474, -1))[0]) < 1e-6
