# SPDX-License-Identifier: Apache-2.0
"""Whether a character with hair on joints faces askew."""

from neuralocks_core.anatomy.joint_names import leaf

from ..skel.stage_rig import StageRig

ASKEW = 2.0
"""A bind pose that faces farther off a stage's axis than this [degrees] gets a note."""


def askew_notes(rig: StageRig) -> list[str]:
    """The note on a bind pose that faces askew: the network's axes follow from where left and right are."""
    character, names = rig.character, rig.joints.names
    if character.sides is None:
        return []
    angle = character.facing_angle
    off = angle - 90 * round(angle / 90)
    if abs(off) <= ASKEW:
        return []
    by = " and ".join(f"'{leaf(names[joint])}'" for joint in character.sides)
    return [
        f"{rig.path}: judged by {by}, its bind pose faces {abs(off):.0f} degrees off the stage's nearest axis, and hair is "
        "moved as if it did; bind it symmetrically, or turn an engine's axes as the C header says"
    ]
