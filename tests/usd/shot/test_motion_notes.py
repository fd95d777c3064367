# SPDX-License-Identifier: Apache-2.0
"""What `inspect`, and training, say about motion capture."""

import re

import numpy as np
import pytest

from neuralocks_core.errors import NeuralocksError
from usd.models.clip_file import read_clip
from usd.review.inspect import inspect
from usd.shot.stage import read_rigs

from ...core.animation.written_bvh import Z_UP, along_x, write_bvh
from ..shots import Recipe, write_shot

STAND, LIE = [{}] * 4, [{}] * 2 + [{"hips": (0, -90, 0)}] * 3


@pytest.mark.parametrize(
    ("frames", "zero", "turn", "up", "said"),
    [
        (STAND, None, None, "Y", []),
        (STAND, Z_UP, Z_UP, "Z", []),
        (LIE, None, None, "Y", ["lies in most frames"]),
        (STAND, None, Z_UP, "Y", ["lies in most frames"]),
        (STAND, along_x, None, "Y", ["stands along no axis"]),
        (LIE, Z_UP, Z_UP, "Z", ["lies in most frames"]),
    ],
)
def test_which_axis_was_up_and_what_was_guessed_is_told(tmp_path, frames, zero, turn, up, said):
    axes = (lambda part: zero.T) if isinstance(zero, np.ndarray) else zero
    path = write_bvh(tmp_path / "take.bvh", frames, axes=axes, turn=turn)
    facts, notes = inspect(path), []
    character = read_rigs(write_shot(tmp_path, Recipe(bound="mesh")))[0].character
    read_clip(str(path), character, notes)
    assert facts["up axis"] == up and facts["stops"] == []
    assert len(facts["spoils"]) == len(said) and all(a in b for a, b in zip(said, facts["spoils"]))
    assert all(note.startswith("take.bvh: ") for note in facts["spoils"])
    assert notes == facts["spoils"]


def test_motion_of_no_person_is_told(tmp_path):
    path = write_bvh(tmp_path / "take.bvh", STAND)
    path.write_text(path.read_text().replace("Head", "Top").replace("Neck", "Column"))
    (said,) = inspect(path)["spoils"]
    assert said == "take.bvh: no joint is named like a head, so it moves no character; rename its joints"


def test_motion_without_a_head_is_named_by_its_file(tmp_path):
    """--head and --joint name joints of the character, not of the motion."""
    path = write_bvh(tmp_path / "take.bvh", STAND)
    number = iter(range(100))
    nameless = re.sub(r"(ROOT|JOINT) \S+", lambda found: f"{found[1]} Bone{next(number)}", path.read_text())
    character = read_rigs(write_shot(tmp_path, Recipe(bound="mesh")))[0].character
    path.write_text(nameless)
    with pytest.raises(
        NeuralocksError, match=rf"^{re.escape(str(path))}: no joint is named like a head; rename it in the"
    ):
        read_clip(str(path), character)
