# SPDX-License-Identifier: Apache-2.0
"""A joint's own name, without those of its parents and of its rig."""

import pytest

from neuralocks_core.anatomy.humanoid import find_humanoid
from neuralocks_core.anatomy.joint_names import own_names

BODY = ["Hips", "Spine", "Chest", "Neck", "Head", "LeftArm", "RightArm"]
OVER = [-1, 0, 1, 2, 3, 2, 2]


def _paths(prefix, names=BODY, parents=OVER):
    paths = []
    for name, parent in zip(names, parents, strict=True):
        paths.append((f"{paths[parent]}/" if parent >= 0 else "") + prefix + name)
    return paths


@pytest.mark.parametrize("prefix", ["", "rig:", "Kamille_", "HatsuneMiku_", "Hatsune_Miku_01_", "LongHair_", "Hair_"])
def test_the_rigs_name_is_no_part_of_a_joints(prefix):
    paths = _paths(prefix, [*BODY, "hair_1", "tail_02"], [*OVER, 4, 7])
    assert own_names(paths, 4) == [*BODY, "hair_1", "tail_02"]


def test_a_rig_without_names_for_its_trunk_has_its_name_on_nearly_all_joints():
    german = ["Becken", "Rumpf", "Brust", "Hals", "Kopf", "Arm", "Arm2"]
    assert own_names(_paths("Kamille_", german, OVER), 4) == german
    assert own_names([f"Kamille_{name}" for name in ("首", "頭", "左腕", "前髪_1")], 1) == [
        "首",
        "頭",
        "左腕",
        "前髪_1",
    ]


@pytest.mark.parametrize(
    ("names", "head"),
    [
        (["Neck", "Head", *(f"pony_{i}" for i in range(40))], 1),
        (["neck", "head", *(f"FACIAL_C_Hair{i}" for i in range(40))], 1),
        (["root", "wig_root", *(f"wig_{i}" for i in range(40))], 1),
        (["Neck", "Face_Head", "Face_Jaw"], 1),
        (["Hips", "Head_M", "Head_Jaw"], 1),
    ],
)
def test_what_only_joints_of_the_head_begin_with_says_what_they_are(names, head):
    paths = names[: head + 1]
    paths = ["/".join(names[: i + 1]) for i in range(head + 1)] + [
        f"{'/'.join(paths)}/{name}" for name in names[head + 1 :]
    ]
    assert own_names(paths, head) == names


def test_without_a_head_only_a_colon_tells():
    assert own_names(["a:hips", "a:hips/b_pony"], None) == ["hips", "b_pony"]


def test_a_rig_called_hair_has_the_joints_of_any():
    assert find_humanoid(_paths("Hair_"), OVER).joints == find_humanoid(_paths(""), OVER).joints


@pytest.mark.parametrize("rig", ["Élise_", "初音Rig_", "Русалка Rig ", "µ_Rig_"])
def test_a_name_that_begins_with_letters_of_no_word_is_left(rig):
    """Nothing can be taken off; it ends all the same."""
    assert own_names(_paths(rig), 4) == [f"{rig}{name}" for name in BODY]
