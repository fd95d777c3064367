# SPDX-License-Identifier: Apache-2.0
"""BVH files give the motion they hold, and hostile ones one clear line."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats.bvh import read_bvh
from neuralocks_core.formats.bvh_words import PIECE, Words
from tests.shared_data import SHARED

REAL = SHARED / "motion"

TEXT = """HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT head
  {
    OFFSET 0 80 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 20 0
    }
  }
  JOINT foot
  {
    OFFSET 0 -90 0
    CHANNELS 3 Zrotation Xrotation Yrotation
  }
}
MOTION
Frames: 2
Frame Time: 0.04
0 90 0  0 0 0  0 0 0  0 0 0
10 90 0  90 0 30  0 90 0  0 0 0
"""


def written(folder, text=TEXT):
    path = folder / "take.bvh"
    path.write_text(text)
    return path


def test_channels_turn_in_the_order_in_which_they_stand(tmp_path):
    motion = read_bvh(written(tmp_path))
    assert motion.unit == 0.01 and motion.skeleton.names == ("hips", "hips/head", "hips/foot")
    assert np.allclose(motion.clip.times, [0, 0.04])
    assert np.allclose(motion.clip.joints[0, 1, :3, 3], [0, 1.7, 0])
    # Z 90 degrees, then Y 30 about the axes so turned: Y goes to -X; X goes to Y, tipped by the second turn.
    turn = motion.clip.joints[1, 0, :3, :3]
    assert np.allclose(turn @ [0, 1, 0], [-1, 0, 0])
    assert np.allclose(turn @ [1, 0, 0], [0, np.cos(np.pi / 6), -np.sin(np.pi / 6)])
    assert np.allclose(motion.clip.joints[1, 1, :3, 3], [0.1 - 0.8, 0.9, 0])


def test_joints_of_one_name_get_others_that_no_joint_has(tmp_path):
    text = TEXT.replace("JOINT foot", "JOINT head_3")
    text = text.replace("}\nMOTION", "  JOINT head\n  {\n    OFFSET 1 0 0\n  }\n}\nMOTION")
    names = read_bvh(written(tmp_path, text)).skeleton.names
    assert names == ("hips", "hips/head", "hips/head_3", "hips/head_4")


def test_a_joint_may_turn_about_one_axis_only(tmp_path):
    text = TEXT.replace("CHANNELS 3 Zrotation Xrotation Yrotation\n  }", "CHANNELS 1 Xrotation\n  }")
    turn = read_bvh(written(tmp_path, text.replace("  0 0 0\n", "  90\n"))).clip.joints[:, 2, :3, :3]
    assert np.allclose(turn[0] @ [0, 1, 0], [0, 0, 1])


def test_somebody_stands_a_twentieth_less_high_than_stretched_out(tmp_path):
    """2.5 m along the bones are a person of 2.4 m in centimetres, who may be a giant."""
    assert read_bvh(written(tmp_path, TEXT.replace("OFFSET 0 80 0", "OFFSET 0 140 0"))).unit == 0.01


def test_the_end_of_the_head_counts_for_how_tall_somebody_is(tmp_path):
    """A child of 1.3 m is one of 1.1 m up to the joint, too short to be taken for a person in centimetres."""
    assert read_bvh(written(tmp_path, TEXT.replace("OFFSET 0 80 0", "OFFSET 0 20 0"))).unit == 0.01


@pytest.mark.parametrize(
    ("old", "new", "fact"),
    [
        ("Frames: 2", "Frames: 900000000000", "says 900000000000 frames"),
        ("Frames: 2", "Frames: -1", "frames"),
        ("Frames: 2", "Frames: 3", "frames"),
        ("Frames: 2", "Frames: 0", "no frame"),
        ("CHANNELS 3", "CHANNELS 1e9", "says 1e9 channels"),
        ("CHANNELS 3", "CHANNELS 7", "channels"),
        ("Zrotation Xrotation Yrotation\n    End", "Zrotation Zrotation Yrotation\n    End", "channels"),
        ("OFFSET 0 80 0", "OFFSET 0 nan 0", "number"),
        ("OFFSET 0 80 0", "OFFSET 0 1e300 0", "number"),
        ("0.04", "0", "frame time"),
        ("0.04", "0.5", "frame time of 0.5 s; export it with the right rate, at most 0.2 s"),
        ("0.04", "240", "240 s; write 0.00416667 if that is frames a second$"),
        ("0.04", "30", "30 s; write 0.0333333 if that is frames a second, 0.03 if it is milliseconds"),
        ("0.04", "33.333", "33.333 s; write 0.0300003 if .*, 0.033333 if it is milliseconds"),
        ("Frames: 2", "Frames 2", "'Frames 2.* stands where 'Frames:' should"),
        ("Frame Time: 0.04", "Frame Rate: 25", "'Frame.* stands where 'Frame Time:' should"),
        ("10 90 0", "10 # 90 0", "not a number"),
        ("10 90 0", "10 x 0", "not a number"),
        ("10 90 0", "10 inf 0", "frame 1"),
        ("10 90 0", "10 90 0 7", "12 channels, and a line of its frames holds 13 numbers"),
        ("HIERARCHY", "MOTION", "HIERARCHY"),
        ("}\nMOTION", "MOTION", "MOTION"),
    ],
)
def test_what_cannot_be_meant_is_said_in_one_line(tmp_path, old, new, fact):
    assert old in TEXT
    with pytest.raises(NeuralocksError, match=fact) as caught:
        read_bvh(written(tmp_path, TEXT.replace(old, new, 1)))
    assert "take.bvh" in str(caught.value) and "\n" not in str(caught.value) and ";" in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Frames: 2", "Frames:2"),
        ("Frames: 2", "frames : 2"),
        ("Frame Time: 0.04", "Frame Time:0.04"),
        ("Frame Time: 0.04", "Frame Time : 0.04"),
        ("HIERARCHY", "# made by hand\n  // { OFFSET\n#\n\nHIERARCHY"),
        ("MOTION", "//the motion\r\nMOTION"),
        ("10 90 0", "# here it turns\n10 90 0"),
        ("10 90 0", " // here it turns\r\n10 90 0"),
    ],
)
def test_what_other_programs_write_is_read(tmp_path, old, new):
    assert old in TEXT
    expected, found = (read_bvh(written(tmp_path, text)) for text in (TEXT, TEXT.replace(old, new, 1)))
    assert np.array_equal(found.clip.joints, expected.clip.joints)
    assert np.array_equal(found.clip.times, expected.clip.times)


def test_frames_beyond_those_told_are_passed_over(tmp_path):
    """Cut takes may keep them, and a frame may go on in another line."""
    expected = read_bvh(written(tmp_path)).clip.joints
    for more in ("20 90 0  0 0 0  0 0 0  0 0 0\n", "# 1 2 3 4 5 6 7 8 9 10 11 12 13\n20 90 0\n0 0 0", "\x1a"):
        assert np.array_equal(read_bvh(written(tmp_path, TEXT + more)).clip.joints, expected)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_text_in_other_encodings_is_read(tmp_path, encoding):
    expected = read_bvh(written(tmp_path)).clip.joints
    (tmp_path / "take.bvh").write_bytes(TEXT.encode(encoding))
    assert np.array_equal(read_bvh(tmp_path / "take.bvh").clip.joints, expected)


def test_long_takes_may_hold_comments_anywhere(tmp_path):
    lines = [f"{i} 90 0  0 0 0  0 0 0  0 0 0" for i in range(6000)]
    text = TEXT[: TEXT.index("0 90 0  0 0 0")].replace("Frames: 2", "Frames: 6000")
    assert sum(map(len, lines)) > 4 * PIECE
    expected = read_bvh(written(tmp_path, text + "\n".join(lines))).clip.joints
    found = read_bvh(written(tmp_path, text + f"\n#{' a 1 2 comment 3' * 20}\n".join(lines))).clip.joints
    assert np.array_equal(found, expected)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(0, len(TEXT)), junk=st.binary(max_size=30))
def test_truncated_and_spoilt_files_are_refused_or_read(tmp_path, cut, junk):
    path = tmp_path / "spoilt.bvh"
    path.write_bytes(TEXT.encode()[:cut] + junk + TEXT.encode()[cut + len(junk) :])
    try:
        read_bvh(path)
    except NeuralocksError as error:
        assert "spoilt.bvh" in str(error)


def test_deep_hierarchies_do_not_overflow(tmp_path):
    deep = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\n" + "JOINT b\n{\n" * 100_000
    with pytest.raises(NeuralocksError):
        read_bvh(written(tmp_path, deep))


def test_joints_without_channels_do_not_make_a_small_file_a_huge_clip(tmp_path):
    still = "".join(f"JOINT j{i} {{ OFFSET 0 1 0 CHANNELS 0 }} " for i in range(2000))
    text = f"HIERARCHY ROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation {still} }} MOTION Frames: 2500 Frame Time: 0.01 "
    with pytest.raises(NeuralocksError, match="2500 frames of 2001 joints"):
        read_bvh(written(tmp_path, text + "0 " * 2500))


def test_small_files_do_not_ask_for_much_memory(tmp_path):
    frames = TEXT.replace("Frames: 2", "Frames: 500").replace("10 90 0  90", "10 90 0  " + "0" * 50_000 + " ")
    deep = "".join(f"JOINT {'x' * 190}{i} {{ OFFSET 0 1 0 CHANNELS 0 }} "[:-2] for i in range(1000))
    names = f"HIERARCHY ROOT r {{ OFFSET 0 0 0 CHANNELS 1 Xrotation {deep}"
    for text, fact in ((frames + "0 " * 6000, "more than 64 characters"), (names, "joint paths of more than")):
        tracemalloc.start()
        with pytest.raises(NeuralocksError, match=fact):
            read_bvh(written(tmp_path, text))
        assert tracemalloc.get_traced_memory()[1] < 50 * len(text)
        tracemalloc.stop()


def test_reading_takes_little_memory_beside_the_file_and_the_motion(tmp_path):
    count = 360_000
    path = written(tmp_path, "0 " * count)
    tracemalloc.start()
    values, more = Words(path).numbers(count)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(values) == count and not more and peak < path.stat().st_size + 3 * values.nbytes + 40 * PIECE


@pytest.mark.skipif(not REAL.is_dir(), reason="the shared motion capture is not there")
def test_real_files_are_people():
    files = sorted(REAL.glob("*.bvh"))
    assert files
    for path in files:
        motion = read_bvh(path)
        assert 1.0 < np.ptp(motion.skeleton.bind[:, 1, 3]) < 2.2, path.name


@pytest.mark.skipif(not REAL.is_dir(), reason="the shared motion capture is not there")
def test_a_leading_t_pose_is_dropped():
    assert len(read_bvh(REAL / "01_01.bvh").clip.times) == 2751
    assert len(read_bvh(REAL / "02_01.bvh").clip.times) == 343


def test_a_person_in_an_unusual_unit_is_as_tall_as_people(tmp_path):
    """Half-metres, of which no file in use is made."""
    lengths = {"0 80 0": "0 1.6 0", "0 20 0": "0 0.4 0", "0 -90 0": "0 -1.8 0"}
    text = TEXT
    for usual, other in lengths.items():
        text = text.replace(f"OFFSET {usual}", f"OFFSET {other}")
    motion = read_bvh(written(tmp_path, text))
    assert motion.unit == pytest.approx(1.7 / 3.8) and motion.skeleton.bind[1, 1, 3] == pytest.approx(1.6 * 1.7 / 3.8)


@pytest.mark.parametrize("angles, kept", [((0, 70, 75, 80, 85), 4), ((0, 30, 60, 90, 120), 5), ((0, 8, 9, 10, 11), 5)])
def test_a_first_frame_is_dropped_from_which_the_motion_leaps(tmp_path, angles, kept):
    """Not if it goes on as fast, or hardly leaves it."""
    frames = "".join(f"0 90 0  {angle} 0 0  0 0 0  0 0 0\n" for angle in angles)
    motion = read_bvh(written(tmp_path, TEXT.partition("Frames")[0] + "Frames: 5\nFrame Time: 0.04\n" + frames))
    assert len(motion.clip.times) == kept and motion.clip.times[0] == 0
