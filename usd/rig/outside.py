# SPDX-License-Identifier: Apache-2.0
"""Hair joints that do not hang from the head, and that nothing moves therefore."""

import numpy as np

from neuralocks_core.anatomy.joint_names import carrier, leaf
from neuralocks_core.rig.hair_names import says_hair_alone
from neuralocks_core.rig.skinned_mesh import LEAST_WEIGHT

from ..skel.source import StageRig


def outside_notes(source: StageRig) -> list[str]:
    """The note on joints that are named like hair and drive skin, but hang from the neck, say, beside the head. Those of another
    head in the skeleton have a note of their own.
    """
    names, character = source.source.names, source.character
    drives = np.zeros(len(names), bool)
    for mesh in source.meshes:
        drives[mesh.indices[mesh.weights > LEAST_WEIGHT]] = True
    beside = np.flatnonzero(drives & ~character.skeleton.below(character.head))
    loose = [
        names[j] for j in beside if says_hair_alone(names[j]) and "head" not in names[j].rpartition("/")[0].lower()
    ]
    if not loose:
        return []
    above = carrier(names[character.head], *loose)
    chest = character.humanoid.get("upper_chest")
    neck = names[character.head].removeprefix("" if chest is None else names[chest]).split("/")
    hang, them = f"hangs from '{above}' and is", "it"
    if loose[1:]:
        hang, them = f"and {len(loose) - 1} more hang from '{above}' and are", "them"
    remedy = f"hang {them} from the head in the rig"
    if above in neck:
        remedy = f"to move all, train and bake with --head {above}"
    return [f"{source.path}: '{leaf(loose[0])}' {hang} not moved; {remedy}"]
