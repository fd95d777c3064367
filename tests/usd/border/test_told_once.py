# SPDX-License-Identifier: Apache-2.0
"""What is the same of many prims is told once; what differs in anything else stays."""

from usd.border.told_once import told_once
from usd.review.facts_text import as_text


def test_a_crowd_is_one_note():
    notes = [f"/Crowd/c{i}/Rig: no SkelRoot is above /Crowd/c{i}/Skin; type /Crowd/c{i} so" for i in range(40)]
    other = "/Crowd/c3/Hair: 3 strands without two distinct points"
    assert told_once([*notes[:20], other, *notes[20:]]) == [
        f"{notes[0]} (likewise 39 more: {', '.join(f'/Crowd/c{i}/Rig' for i in range(1, 7))}, ..., /Crowd/c39/Rig)",
        other,
    ]


def test_two_notes_and_what_differs_in_more_than_paths_stay():
    few = ["/A/Rig: lies down", "/B/Rig: lies down"]
    assert told_once([*few, *few]) == few
    numbers = [f"/A/Hair_{i}: {i} strands" for i in range(5)]
    assert told_once(numbers) == numbers
    nameless = ["root/head is bent", "root/neck is bent", "root/hips is bent"]
    assert told_once(nameless) == nameless


def test_alike_facts_are_printed_once():
    def skeleton(path: str, joints: int) -> dict:
        return {"path": path, "joints": joints, "meshes": [f"{path}/Skin"], "head": "root/head"}

    text = as_text({"skeletons": [skeleton("/A", 3), skeleton("/B", 4), skeleton("/C", 3)]})
    assert text.count("joints: 3") == 1 and text.count("joints: 4") == 1
    assert "likewise: /C" in text and "path: /B" in text and "path: /C" not in text


def test_the_prims_that_differ_are_named_behind_a_file_that_does_not():
    notes = [f"shot.usda: could not open /shots/gone.usda, introduced by </{name}>" for name in "ABCD"]
    assert told_once(notes) == [f"{notes[0]} (likewise 3 more: /B, /C, /D)"]
