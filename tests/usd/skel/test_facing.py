# SPDX-License-Identifier: Apache-2.0
"""Characters whose left and right are the wrong way round are told: hair would move as if they faced backwards."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from neuralocks_core.anatomy.humanoid import find_humanoid
from neuralocks_core.character import Character, Skeleton
from usd.shot.stage import read_shot
from usd.skel.facing import backwards_notes

SHOT = Path(__file__).parents[3] / "examples" / "shot" / "shot.usda"
ARMS = {"left_upper_arm": "upperarm_r", "right_upper_arm": "upperarm_l"}
PLACES = {
    "hips": (0, 1, 0),
    "hips/spine": (0, 1.2, 0),
    "hips/spine/head": (0, 1.6, 0),
    "hips/spine/arm_L": (0.2, 1.4, 0),
    "hips/spine/arm_R": (-0.2, 1.4, 0),
    "hips/thigh_L": (0.1, 0.9, 0),
    "hips/thigh_R": (-0.1, 0.9, 0),
    "hips/spine/head/eye_L": (0.03, 1.65, 0.08),
    "hips/spine/head/eye_R": (-0.03, 1.65, 0.08),
}


def _told(names: list[str], **by_hand: str) -> list[str]:
    parents = [names.index(name.rpartition("/")[0]) if "/" in name else -1 for name in names]
    bind = np.tile(np.eye(4), (len(names), 1, 1))
    bind[:, :3, 3] = [PLACES[name] for name in names]
    humanoid = find_humanoid(names, parents, bind[:, :3, 3], by_hand)
    character = Character(Skeleton(names, np.array(parents), bind), None, humanoid)
    return backwards_notes(SimpleNamespace(path="/Rig", names=names), character)


@pytest.mark.parametrize(
    ("gone", "witness"),
    [((), "its eyes point"), (("eye",), "'thigh_L' and 'thigh_R' say"), (("eye", "thigh"), None)],
    ids=["eyes", "legs", "nothing"],
)
def test_whatever_else_has_a_side_tells_that_arms_are_swapped(gone, witness):
    names = [name for name in PLACES if not any(part in name for part in gone)]
    assert not _told(names)
    said = _told(names, left_upper_arm="arm_R", right_upper_arm="arm_L")
    assert [witness in note and note.endswith("swapped, check --joint") for note in said] == [True] * bool(witness)


@pytest.mark.parametrize(("below_foot", "told"), [("heel", False), ("knee_pole", False), ("toe", True), ("Bone", True)])
def test_what_is_behind_a_foot_tells_only_if_it_may_be_toes(below_foot, told, monkeypatch):
    """A heel or a pole is behind a foot that points ahead."""
    for side, x in (("L", 0.1), ("R", -0.1)):
        leg = f"hips/thigh_{side}/shin_{side}"
        places = {
            leg: (x, 0.5, 0),
            f"{leg}/foot_{side}": (x, 0.1, 0),
            f"{leg}/foot_{side}/{below_foot}_{side}": (x, 0.02, -0.1),
        }
        for name, place in places.items():
            monkeypatch.setitem(PLACES, name, place)
    assert bool(_told([name for name in PLACES if "eye" not in name])) == told


def test_a_shot_whose_arms_are_named_by_hand_the_wrong_way_round_says_so():
    assert not [note for note in read_shot(SHOT).notes if "faces" in note]
    (said,) = [note for note in read_shot(SHOT, joints=ARMS).notes if "faces" in note]
    assert "judged by 'upperarm_r' and 'upperarm_l', it faces away from where its toes point" in said
