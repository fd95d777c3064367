# SPDX-License-Identifier: Apache-2.0
"""What a groom was baked from: recorded in the bake, and compared with the current shot."""

from pxr import Usd

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.groom import Groom
from neuralocks_core.sketch import alike, sketch

from .bakes.bake_record import recorded, recorded_joint, seen_as_written
from .carriers.attach import Attachment

INPUTS = "inputs"
"""Key of what `made_from` gives, in the record of a bake."""
NEAR = {"groom": 1e-4, "animation": 1e-6}
"""Points at rest are in single precision, and some are brought from one space to another; motion is read as it is authored."""
AT_A_TIME = 1 << 16


def made_from(found: Attachment, groom: Groom) -> dict[str, str]:
    """Sketches of the groom at rest, seen from the head, and of what moves its character."""
    points, canonical = groom.points, found.character.canonical
    blocks = (canonical(points[i : i + AT_A_TIME].astype(float)) for i in range(0, len(points), AT_A_TIME))
    told = f"{groom.strand_count} strands {sketch(blocks)}"
    return {"groom": told, "animation": found.rig.motion_sketch}


def unlike(one: dict, other: dict) -> list[str]:
    """Which inputs differ between two records, of those that both have."""
    mine, theirs = (made if isinstance(made := facts.get(INPUTS), dict) else {} for facts in (one, other))
    return [
        name for name in NEAR if name in mine and name in theirs and not _same(mine[name], theirs[name], NEAR[name])
    ]


def baked_from_others(prim: Usd.Prim, found: Attachment, groom: Groom) -> list[str]:
    """The notes on a bake over another groom or animation than the one it was made from.

    If time codes are shifted or stretched between the bake and the stage, units differ, or other joints are taken as the head or its
    body's, they cannot be compared.
    """
    told, border = recorded(prim), found.rig.border
    if INPUTS not in told or not seen_as_written(prim, border) or recorded_joint(prim) != found.joint:
        return []
    if not _mapped_as(told.get("joints"), found):
        return []
    return [
        f"{prim.GetPath()}: the shot's {name} is not the one that this was baked from; bake again"
        for name in unlike(told, {INPUTS: made_from(found, groom)})
    ]


def _mapped_as(given, found: Attachment) -> bool:
    """Whether the joints that the user gave for a bake are those of the character now."""
    humanoid, names = found.character.humanoid, found.character.skeleton.names
    now = {meaning: leaf(names[joint]) for meaning, joint in humanoid.items()}
    joints = given if isinstance(given, dict) else {}
    return all(now.get(meaning) == leaf(str(joint)) for meaning, joint in joints.items())


def _same(one: str, other: str, near: float) -> bool:
    first, second = (str(text).rpartition("strands ") for text in (one, other))
    try:
        return first[0] == second[0] and alike(first[2], second[2], near)
    except ValueError:  # written by another program
        return True
