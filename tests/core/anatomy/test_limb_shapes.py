# SPDX-License-Identifier: Apache-2.0
"""Arms and legs are found where names say nothing, and are those that names tell where they do."""

import numpy as np
import pytest

from neuralocks_core.anatomy.humanoid import find_humanoid
from neuralocks_core.anatomy.limb_shapes import limbs_by_shape
from neuralocks_core.formats.bvh import read_bvh
from tests.shared_data import SHARED

REAL = SHARED / "motion"
JOINTS = {  # name: parent, place: +Z ahead, the character's left at +X
    "root": (None, (0, 0, 0)),
    "pelvis": ("root", (0, 1.0, 0)),
    "waist": ("pelvis", (0, 1.15, 0)),
    "breast": ("waist", (0, 1.4, 0)),
    "throat": ("breast", (0, 1.5, 0)),
    "top": ("throat", (0, 1.6, 0.02)),
    **{
        f"{side}{name}": (f"{side}{parent}" if parent[0] == "_" else parent, (sign * x, y, z))
        for side, sign in (("l", 1), ("r", -1))
        for name, parent, (x, y, z) in (
            ("_collar", "breast", (0.03, 1.42, 0)),
            ("_arm", "_collar", (0.18, 1.43, 0)),
            ("_elbow", "_arm", (0.42, 1.3, 0)),
            ("_hand", "_elbow", (0.62, 1.15, 0.03)),
            ("_finger", "_hand", (0.70, 1.08, 0.03)),
            ("_cape", "breast", (0.1, 1.4, -0.1)),
            ("_cape2", "_cape", (0.12, 1.0, -0.15)),
            ("_cape3", "_cape2", (0.14, 0.5, -0.2)),
            ("_thigh", "pelvis", (0.1, 0.95, 0)),
            ("_knee", "_thigh", (0.11, 0.5, 0.02)),
            ("_ankle", "_knee", (0.12, 0.08, -0.03)),
            ("_skirt", "pelvis", (0.2, 0.95, 0)),
            ("_skirt2", "_skirt", (0.25, 0.7, 0)),
            ("_skirt3", "_skirt2", (0.3, 0.45, 0)),
            ("_tail", "throat", (0.08, 1.5, -0.1)),
            ("_tail2", "_tail", (0.1, 1.2, -0.15)),
            ("_tail3", "_tail2", (0.1, 0.9, -0.15)),
        )
    },
}
TOES = {f"{side}_toes": (f"{side}_ankle", (sign * 0.13, 0.02, 0.12)) for side, sign in (("l", 1), ("r", -1))}
MEANT = {
    f"{word}_{part}": f"{side}_{joint}"
    for side, word in (("l", "left"), ("r", "right"))
    for part, joint in (
        ("shoulder", "collar"),
        ("upper_arm", "arm"),
        ("lower_arm", "elbow"),
        ("hand", "hand"),
        ("upper_leg", "thigh"),
        ("lower_leg", "knee"),
        ("foot", "ankle"),
    )
}
Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]])


def limbs(joints=JOINTS, turn=None, sides=None) -> dict[str, str]:
    """What is found among joints whose names are not read, each by our own name for it."""
    names = list(joints)
    parents = [names.index(parent) if parent else -1 for parent, _ in joints.values()]
    places = np.array([place for _, place in joints.values()]) @ (np.eye(3) if turn is None else turn).T
    way = [names.index(name) for name in ("top", "throat", "breast", "waist", "pelvis", "root")]
    found = limbs_by_shape(way, parents, places, sides or [""] * len(names))
    return {part: names[joint] for limb in found.values() for part, joint in limb.items()}


def about_y(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


@pytest.mark.parametrize("turn", [np.eye(3), Z_UP, 100 * Z_UP], ids=["Y up", "Z up", "centimetres"])
def test_limbs_are_found_among_capes_skirts_and_tails(turn):
    assert limbs(turn=turn) == MEANT


@pytest.mark.parametrize("degrees", [90, 180, 300])
def test_toes_tell_where_a_character_looks(degrees):
    assert limbs(JOINTS | TOES, turn=Z_UP @ about_y(degrees)) == MEANT


def test_sides_in_names_win_and_without_any_hint_there_are_none():
    sides = [{"l": "left", "r": "right"}.get(name.split("_")[0], "") for name in JOINTS]
    assert limbs(turn=about_y(90), sides=sides) == MEANT
    assert limbs(turn=about_y(180), sides=sides) == MEANT
    assert limbs(turn=about_y(90)) == {}


def test_an_animal_on_four_legs_has_no_arms():
    bent = {"pelvis": (0, 0.6, -0.5), "waist": (0, 0.65, -0.2), "breast": (0, 0.65, 0.3), "throat": (0, 0.7, 0.5)}
    bent |= {"top": (0, 0.8, 0.6), "root": (0, 0.6, -0.55)}
    legs = {
        f"{side}_{name}{joint}": (f"{side}_{name}{joint - 1}" if joint else on, (sign * 0.12, 0.6 - 0.28 * joint, z))
        for side, sign in (("l", 1), ("r", -1))
        for name, on, z in (("fore", "breast", 0.3), ("hind", "pelvis", -0.5))
        for joint in range(3)
    }
    assert limbs({name: (JOINTS[name][0], place) for name, place in bent.items()} | legs) == {}


def test_twist_joints_make_no_hand_of_an_elbow():
    """Two of them and the hand are three children, like fingers; they lie on the forearm."""
    twists = {
        f"{side}_twist{n}": (
            f"{side}_elbow",
            tuple(np.array([sign * 0.42, 1.3, 0]) + 0.3 * n * np.array([sign * 0.2, -0.15, 0.03])),
        )
        for side, sign in (("l", 1), ("r", -1))
        for n in (1, 2)
    }
    assert limbs(JOINTS | TOES | twists) == MEANT


def test_half_a_character_has_arms():
    """And no feet that tell where it looks."""
    half = {name: joint for name, joint in JOINTS.items() if joint[1][1] > 0.9 or name == "root"}
    for name in ("skirt", "thigh", "cape", "cape2", "tail", "tail2", "tail3"):
        half = {each: joint for each, joint in half.items() if each.partition("_")[2] != name}
    arms = {part: joint for part, joint in MEANT.items() if "leg" not in part and "foot" not in part}
    assert limbs(half) == arms and limbs(half, turn=Z_UP) == arms


def test_a_trunk_alone_and_broken_places_have_no_limbs():
    trunk = {name: JOINTS[name] for name in ("root", "pelvis", "waist", "breast", "throat", "top")}
    assert limbs(trunk) == {}
    assert limbs({name: (parent, (0, 0, 0)) for name, (parent, _) in JOINTS.items()}) == {}
    assert limbs(JOINTS | {"l_finger": ("l_hand", (np.nan, 0, 0))}) == {}


@pytest.mark.skipif(not REAL.is_dir(), reason="the shared motion capture is not there")
@pytest.mark.parametrize("file", ["01_01", "131_01", "60_05_scaled"])
def test_captured_skeletons_without_their_names_have_the_limbs_that_names_tell(file):
    skeleton = read_bvh(REAL / f"{file}.bvh").skeleton
    places = skeleton.bind[:, :3, 3]
    named = find_humanoid(skeleton.names, skeleton.parents, places)
    numbers: list[str] = []
    for joint, parent in enumerate(skeleton.parents):
        numbers.append(f"{numbers[parent]}/Bone{joint:03}" if parent >= 0 else "Bone000")
    found = find_humanoid(numbers, skeleton.parents, places, {"head": numbers[named["head"]]})
    limbs = {name for name in named if name.startswith(("left", "right")) and "eye" not in name}
    assert {name: found[name] for name in limbs} == {name: named[name] for name in limbs}
    assert found["upper_chest"] == named["upper_chest"]
    assert "by its place" in found.reasons["left_hand"]
