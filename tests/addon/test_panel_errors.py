# SPDX-License-Identifier: GPL-3.0-or-later
"""Notes of a bake as the panel tells them."""

import ast
from pathlib import Path

import pytest

from dcc_addon.services.panel.panel_errors import WORDS, for_the_panel
from neuralocks_core.models.model_file import REMEDIES

ROOT = Path(__file__).resolve().parents[2]


def test_all_words_of_the_command_line_are_said_there():
    """Words that the core and the USD layer say otherwise by now would reach the panel as they are."""
    said = [
        text
        for package in ("neuralocks_core", "usd")
        for path in (ROOT / package).rglob("*.py")
        for text in _texts(path)
    ]
    assert [word for word, _ in WORDS if not any(word in text for text in said)] == []


def _texts(path: Path):
    """The texts in a module's code, with gaps where values go."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.JoinedStr):
            yield "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def test_prims_become_objects():
    """Each prim becomes its own object, even if its path begins like another one's."""
    prims = {"前髪": "/Character/Hair___", "Hair.L": "/Character/Hair_L", "Hair L": "/Character/Hair_L_2"}
    said = for_the_panel(
        "/Character/Hair_L_2: as /Character/Hair_L, not /Character/Hair___ or /Character/Hair_Lo", prims
    )
    assert said == "Hair L: as Hair.L, not 前髪 or /Character/Hair_Lo"
    assert for_the_panel("/Character: as it is", {}) == "/Character: as it is"


@pytest.mark.parametrize(
    "note",
    [
        "Rig: no joint found for neck, chest; the next one towards the trunk is used, or name it with --joint",
        "Rig: no joint found for left_lower_arm, so the arms count as bound in a T-pose; "
        "name it with --joint left_lower_arm=JOINT",
        "Rig: its head jumps to another place at 13; the hair starts anew there (--cuts says where)",
        "Rig: its head jumps at 3,4, less than 0.2 s from one jump to the next, so these are not taken as cuts and the hair is "
        "flung; repair the animation, or name them all if they are (--cuts 3,4,20, ...)",
        "Rig: its head jumps to another place at 13; a loop has no cuts, so the hair is flung there; leave out --loop, or repair "
        "the animation",
        "Rig: 'curl' and 3 more hang from 'neck' and are not moved; to move all, train and bake with --head neck",
        "Rig: 'curl' hangs from 'head_2', not from 'head_1', so it is not moved; take that head with --head head_2",
        "Rig: joint 'neck' is head and neck at once; check --joint and --head",
        "frames: more than 1000000 samples; give fewer with --frames FIRST:LAST:STEP",
        "Rig: its animation begins with the bind or rest pose and leaps to another at 2, which flings the hair; if the first pose "
        "is only a reference, let the hair start anew there (--cuts 2,41)",
        "Rig: 'neck_ctrl' is read as neck, but in training 'neck' was, which is here, too; check --joint neck=neck",
        "model: the character is 100 times as large as the one that the model was trained for; check metersPerUnit and the "
        "character's scale, or train a model for this rig",
        "Hair: lies 2 m from joint 'head' of Rig and on no skin, so this trains on hair that is not on the head; put it where the head "
        "is in the bind pose, and check the file's metersPerUnit and upAxis",
        "Hair: the longest strand reaches 30 m; check the stage's metersPerUnit",
        "Hair of Hero: its skel binding puts its roots 0.44 m from the skin of Rig; "
        "check its unit and primvars:skel:geomBindTransform",
        "the model was trained with one material, so stiffness, weight and damping change nothing; "
        "train one with random_materials=True, as the other ways of training do",
        *(f"training: it diverged, its loss is not finite after 3 steps; {remedy}" for remedy in REMEDIES.values()),
        f"training: it diverged, its loss is not finite after 3 steps; {REMEDIES['strands']} than 0.002",
    ],
)
def test_notes_name_what_the_panel_has(note):
    said = for_the_panel(note)
    assert not any(
        word in said
        for word in ("--", "skel", "JOINT", "FIRST", "metersPerUnit", "upAxis", "random_materials", "()", " ;")
    ), said
    assert said[:4] == note[:4], "the subject stays"


@pytest.mark.parametrize(
    ("note", "told"),
    [
        (
            "Rig: joint 'hips/spine/head' is turned by 19 degrees between time codes 1 and 24; a loop must end with the pose "
            "that it begins with",
            "Rig: bone 'head' is turned by 19 degrees between frames 1 and 24; a loop must end with the pose that it begins with",
        ),
        ("Rig: its head joint 'head' does not move", "Rig: its head bone 'head' does not move"),
        ("Hair: hair joint 'a/b' is mirrored", "Hair: hair bone 'b' is mirrored"),
        (
            "Rig: the chest is scaled unevenly, at time code 7 by 9%",
            "Rig: the chest is scaled unevenly, at frame 7 by 9%",
        ),
    ],
)
def test_notes_speak_of_bones_and_frames(note, told):
    assert for_the_panel(note) == told
