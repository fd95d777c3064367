# SPDX-License-Identifier: Apache-2.0
"""Which way a character with hair on joints faces, if that is unexpected."""

import numpy as np

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character

from ..skel.stage_rig import StageRig

ASKEW = 2.0
"""A bind pose that faces farther off a stage's axis than this [degrees] gets a note."""
AHEAD = 0.02
"""Toes and eyes are farther ahead of ankles and head joint than this [m]."""


def facing_notes(rig: StageRig) -> list[str]:
    """The note on a bind pose that faces askew, or backwards: the network's axes follow from where left and right are."""
    character, names = rig.character, rig.source.names
    if character.sides is None:
        return []
    by = " and ".join(f"'{leaf(names[joint])}'" for joint in character.sides)
    if witness := _behind(character):
        return [
            f"{rig.path}: judged by {by}, it faces away from where its {witness} point, and hair is moved as if it did; "
            "left and right are swapped, rename them"
        ]
    angle = character.facing_angle
    off = angle - 90 * round(angle / 90)
    if abs(off) <= ASKEW:
        return []
    return [
        f"{rig.path}: judged by {by}, its bind pose faces {abs(off):.0f} degrees off the stage's nearest axis, and hair is "
        "moved as if it did; bind it symmetrically, or turn an engine's axes as the C header says"
    ]


def _behind(character: Character) -> str:
    """What points away from where the character faces, "toes" or "eyes"; nothing if either points ahead."""
    bind, found = character.skeleton.bind[:, :3, 3] @ character.facing.T, {}
    for side in ("left", "right"):
        foot, eye = (character.humanoid.get(f"{side}_{part}") for part in ("foot", "eye"))
        if foot is not None and character.skeleton.children[foot]:
            ways = bind[character.skeleton.children[foot]] - bind[foot]
            # A heel's joint is nearer to the ankle than the toes'.
            found.setdefault("toes", []).append(ways[np.hypot(ways[:, 0], ways[:, 2]).argmax(), 2])
        if eye is not None:
            found.setdefault("eyes", []).append(bind[eye, 2] - bind[character.head, 2])
    if not found or any(max(ahead) > -AHEAD for ahead in found.values()):
        return ""
    return next(iter(found))
