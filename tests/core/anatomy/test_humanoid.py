# SPDX-License-Identifier: Apache-2.0
"""Semantic joints are found on the rigs that people have."""

import numpy as np
import pytest

from neuralocks_core.anatomy.humanoid import find_humanoid, named_head
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from tests.core.anatomy.common_rigs import RIGS


def rig(text: str) -> tuple[list[str], list[int]]:
    """Joint paths and parents from an indented outline."""
    paths, stack = [], []
    for line in text.strip("\n").split("\n"):
        depth = len(line) - len(line.lstrip())
        stack = [*stack[:depth], line.strip()]
        paths.append("/".join(stack))
    index = {path: i for i, path in enumerate(paths)}
    return paths, [index.get(path.rpartition("/")[0], -1) for path in paths]


@pytest.mark.parametrize("name", RIGS)
def test_finds_the_joints_of_common_rigs(name):
    text, expected = RIGS[name]
    paths, parents = rig(text)
    humanoid = find_humanoid(paths, parents)
    assert {key: paths[humanoid[key]].rpartition("/")[2] for key in expected} == expected


def test_a_limb_goes_on_from_a_joint_given_by_hand():
    paths, parents = rig("hips\n spine\n  head\n  a_L\n   b_L\n    c_L\n     d_L")
    humanoid = find_humanoid(paths, parents, by_hand={"left_upper_arm": "b_L"})
    assert {name: paths[joint][-3:] for name, joint in humanoid.items() if name.startswith("left")} == {
        "left_upper_arm": "b_L",
        "left_lower_arm": "c_L",
        "left_hand": "d_L",
    }


def test_no_joint_is_two_bones_of_a_limb():
    """Neither a single `leg`, the upper one by its place, nor a hand for which an elbow is sought."""
    paths, parents = rig(
        "hips\n spine\n  head\n  l_arm\n   l_hand\n  r_arm\n   r_hand\n l_leg\n  x1\n   x2\n r_leg\n  y1\n   y2"
    )
    heights = {"head": 1.6, "spine": 1.2, "hips": 0.9, "leg": 0.9, "x1": 0.5, "y1": 0.5, "x2": 0.1, "y2": 0.1}
    names = [path.rpartition("/")[2] for path in paths]
    sides = [0.1 * (("l_" in path) - ("r_" in path)) for path in paths]
    places = np.array([(x, heights.get(name.split("_")[-1], 1.3), 0) for name, x in zip(names, sides)])
    limbs = {name: names[joint] for name, joint in find_humanoid(paths, parents, places).items() if "_" in name}
    assert {"left_upper_leg": "l_leg", "left_lower_leg": "x1", "left_foot": "x2"}.items() <= limbs.items()
    assert limbs["left_upper_arm"] == "l_arm" and "left_lower_arm" not in limbs


def test_tails_that_hang_from_the_neck_are_no_head():
    """Whatever the order, and even if the head itself is named in another language."""
    for outline in (
        "hips\n neck\n  tailL\n   tailL2\n  pony\n   pony2\n  Kopf",
        "hips\n neck\n  Kopf\n  pony\n   pony2\n  tailL",
        "hips\n neck\n  headband\n  Kopf",
    ):
        paths, parents = rig(outline)
        heights = {"hips": 1.0, "neck": 1.45, "Kopf": 1.55}
        places = np.array([(0, heights.get(p.rpartition("/")[2], 1.4), 0) for p in paths])
        assert paths[find_humanoid(paths, parents, places)["head"]].endswith("Kopf")


def test_joints_by_hand_win_and_are_checked():
    paths, parents = rig("root\n a\n  b")
    assert find_humanoid(paths, parents, by_hand={"head": "b"})["head"] == 2
    with pytest.raises(NeuralocksError, match="'missing': no such joint; neuralocks inspect lists all"):
        find_humanoid(paths, parents, by_hand={"head": "missing"})
    with pytest.raises(NeuralocksError, match="'Rot': no such joint, perhaps 'root'; "):
        find_humanoid(paths, parents, by_hand={"head": "Rot"})
    with pytest.raises(NeuralocksError, match="no such meaning"):
        find_humanoid(paths, parents, by_hand={"skull": "b"})


def test_a_rig_without_a_head_is_refused_with_the_remedy():
    paths, parents = rig("root\n wheel_L\n wheel_R")
    with pytest.raises(NeuralocksError, match="--head"):
        find_humanoid(paths, parents)


@pytest.mark.timeout(20)
def test_a_joint_without_a_name_is_above_no_other():
    names = ["hips", "", "hips/neck", "hips/neck/head"]
    assert named_head(names) == "hips/neck/head"
    assert named_head(names[:2]) is None


def test_a_hand_is_what_is_farthest_from_its_shoulder():
    """Not what is farthest from where the character stands, as a sleeve is whose arm hangs."""
    arm = "  upperarm_{0}\n   a_{0}\n    sleeve_{0}\n    b_{0}\n"
    paths, parents = rig("hips\n spine\n  head\n" + arm.format("L") + arm.format("R").rstrip())
    places = {"hips": (0, 1), "spine": (0, 1.2), "head": (0, 1.6)}
    places |= {"upperarm": (0.2, 1.4), "a": (0.25, 1.15), "sleeve": (0.4, 1.2), "b": (0.27, 0.9)}
    leaves = [path.rpartition("/")[2] for path in paths]
    at = np.array([(*places[name.partition("_")[0]], 0) for name in leaves])
    at[:, 0] *= [-1 if name.endswith("R") else 1 for name in leaves]
    found = find_humanoid(paths, parents, at)
    for side in ("left", "right"):
        letter = side[0].upper()
        assert leaves[found[f"{side}_lower_arm"]] == f"a_{letter}" and leaves[found[f"{side}_hand"]] == f"b_{letter}"
    assert leaves[found["hips"]] == "hips" and not any("leg" in name for name in found)


def test_missing_joints_fall_back_towards_the_trunk():
    paths, parents = rig("hips\n spine\n  head\n  shoulder_L\n   upper_arm_L")
    humanoid = find_humanoid(paths, parents)
    wanted = {"left_lower_arm": "upper_arm_L", "right_lower_arm": "spine", "right_shoulder": "spine", "neck": "head"}
    assert {name: paths[humanoid.nearest(name)].rpartition("/")[2] for name in wanted} == wanted
    paths, parents = rig("hips\n a\n  b\n   c\n    head")
    assert paths[find_humanoid(paths, parents)["upper_chest"]].endswith("/b")


CONTROLS = (
    "torso\n spine_fk\n  neck\n   head\n  ORG_neck\n   ORG_head\n    ORG_face\n     DEF_jaw\n  ORG_arm_L\n  ORG_arm_R\n"
    "root\n DEF_spine\n  DEF_chest\n   DEF_neck\n    DEF_head"
)
"""A control rig: `head` is a control; copies of it in the same place carry the face and move the skin."""
HEIGHTS = {
    "torso": 1.0,
    "root": 0.0,
    "spine": 1.0,
    "fk": 1.3,
    "chest": 1.3,
    "neck": 1.5,
    "head": 1.6,
    "face": 1.6,
    "jaw": 1.62,
}


def control_rig():
    paths, parents = rig(CONTROLS)
    leaves = [path.rpartition("/")[2] for path in paths]
    places = np.array([(0.0, HEIGHTS.get(name.split("_")[-1], 1.4), 0.0) for name in leaves])
    places[:, 0] = [0.2 * (name.endswith("_L") - name.endswith("_R")) for name in leaves]
    return paths, parents, places, np.array([name.startswith("DEF") for name in leaves]), leaves


@pytest.mark.parametrize("by_hand", [{}, {"head": "DEF_head"}, {"head": "ORG_head"}])
def test_the_head_of_a_control_rig_is_the_copy_that_moves_the_skin(by_hand):
    """Whichever copy is the head, the trunk is that of the control, which the copy follows by constraints alone."""
    paths, parents, places, skinned, leaves = control_rig()
    found = find_humanoid(paths, parents, places, by_hand, skinned)
    named = {meaning: leaves[joint] for meaning, joint in found.items()}
    assert named["head"] == by_hand.get("head", "DEF_head")
    assert (named["neck"], named["upper_chest"], named["hips"]) == ("neck", "spine_fk", "torso")
    assert leaves[find_humanoid(paths, parents, places)["head"]] == "head", "without skin, the name decides"
    skinned[leaves.index("head")] = True
    assert leaves[find_humanoid(paths, parents, places, {}, skinned)["head"]] == "head", (
        "a head with skin needs no copy"
    )


@pytest.mark.parametrize("carries_skin", ["head", "face"])
def test_a_control_named_like_the_head_but_elsewhere_is_not_the_head(carries_skin):
    """It is higher in the hierarchy, and moves no skin; the head may move it by the joints of its face alone."""
    paths, parents = rig("root\n c_head\n hips\n  spine\n   neck\n    head\n     face")
    leaves = [path.rpartition("/")[2] for path in paths]
    places = np.array([(0.0, {"c_head": 2.1}.get(name, HEIGHTS.get(name, 0.9)), 0.0) for name in leaves])
    skinned = np.array([name == carries_skin for name in leaves])
    for known, head in ((skinned, "head"), (None, "c_head"), (np.zeros(len(paths), bool), "c_head")):
        assert leaves[find_humanoid(paths, parents, places, {}, known)["head"]] == head


def test_a_face_that_hangs_from_a_copy_of_the_head_is_on_the_head():
    paths, parents, places, skinned, leaves = control_rig()
    bind = np.tile(np.eye(4), (len(paths), 1, 1))
    bind[:, :3, 3] = places
    character = Character(
        Skeleton(paths, np.array(parents), bind), None, find_humanoid(paths, parents, places, {}, skinned)
    )
    of_head = {name for name, on in zip(leaves, character.of_head) if on}
    assert of_head == {"head", "ORG_head", "ORG_face", "DEF_jaw", "DEF_head"}


def test_of_joints_numbered_alike_the_one_that_moves_skin_is_the_head():
    """Blender's export of deforming bones keeps the bones of other layers that these hang from."""
    spine = "root\n DEF_spine\n  DEF_spine_001\n   DEF_spine_002\n    DEF_spine_003\n     DEF_spine_004\n"
    paths, parents = rig(
        f"{spine}      DEF_spine_006\n     ORG_spine_005\n      ORG_spine_006a\n       ORG_spine_006\n        DEF_jaw"
    )
    skinned = np.array(["DEF" in path.rpartition("/")[2] for path in paths])
    found = [find_humanoid(paths, parents, skinned=each)["head"] for each in (None, skinned)]
    assert [paths[head].rpartition("/")[2] for head in found] == ["ORG_spine_006", "DEF_spine_006"]


def test_of_an_animal_numbered_from_its_tail_the_last_joint_is_the_head():
    """Though the tail is the longer way from the root."""
    tail = "".join(f"{' ' * (5 - n)}DEF_spine_{n:03}\n" for n in (5, 4, 3, 2, 1))
    paths, parents = rig(f"{tail} DEF_spine_006\n  DEF_spine_007\n   DEF_spine_008")
    assert paths[find_humanoid(paths, parents)["head"]].endswith("_008")


def test_a_neck_numbered_like_the_spine_begins_above_the_shoulders():
    """Blender exports deforming bones alone, and the arms of a Rigify rig then hang from nothing."""
    paths, parents = rig(
        "DEF_spine\n DEF_spine_001\n  DEF_spine_002\n   DEF_spine_003\n    DEF_spine_004\n     DEF_spine_005\n"
        "      DEF_spine_006\nDEF_shoulder_L\n DEF_upper_arm_L\nDEF_shoulder_R\n DEF_upper_arm_R"
    )
    heights = [1.01, 1.157, 1.293, 1.466, 1.658, 1.72, 1.781, 1.605, 1.585, 1.605, 1.585]
    sides = [0, 0, 0, 0, 0, 0, 0, 0.02, 0.19, -0.02, -0.19]
    found = find_humanoid(paths, parents, np.column_stack([sides, heights, np.zeros(11)]))
    named = {meaning: paths[joint].rpartition("_")[2] for meaning, joint in found.items()}
    assert (named["head"], named["neck"], named["upper_chest"], named["chest"]) == ("006", "004", "003", "002")
