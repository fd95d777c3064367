# SPDX-License-Identifier: Apache-2.0
"""Joints that nothing moves, though they are or may be hair: those that are not below the head, and those with other names."""

import numpy as np

from neuralocks_core.anatomy.joint_names import carrier, leaf
from neuralocks_core.rig.chain_finding import UNNAMED, left_out, of_the_body
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.hair_names import says_face, says_hair_alone
from neuralocks_core.skinned_body import LEAST_WEIGHT, Body

from ..shot.notes.skeleton_notes import heads_above
from ..skel.stage_rig import StageRig


def outside_notes(stage_rig: StageRig) -> list[str]:
    """The note on joints that are named like hair and drive skin, but are not below the head, for example below the neck. Those of
    another head in the skeleton have their own note; those that an earlier bake moves need none.
    """
    names, character, moved = stage_rig.joints.names, stage_rig.character, stage_rig.joints.baked_hair
    drives = np.zeros(len(names), bool)
    for mesh in stage_rig.meshes:
        drives[mesh.indices[mesh.weights > LEAST_WEIGHT]] = True
    beside = np.flatnonzero(drives & ~character.of_head)
    loose = [
        names[j]
        for j in beside
        if says_hair_alone(character.own_names[j]) and not heads_above(character, j) and names[j] not in moved
    ]
    if not loose:
        return []
    above = carrier(names[character.head], *loose)
    chest = character.humanoid.get("upper_chest")
    neck = names[character.head].removeprefix("" if chest is None else names[chest]).split("/")
    hang, them = f"hangs from '{above}' and is", "it"
    if loose[1:]:
        hang, them = f"and {len(loose) - 1} more hang from '{above}' and are", "them"
    remedy = f"parent {them} to the head in the rig"
    if above in neck:
        remedy = f"to move all, train and bake with --head {above}"
    return [f"{stage_rig.path}: '{leaf(loose[0])}' {hang} not moved; {remedy}"]


def left_out_notes(stage_rig: StageRig, meshes: list[Body], chains: HairChains) -> list[str]:
    """The note on chains below the head that were not found, if others were found automatically.

    Args:
        stage_rig: the character.
        meshes: its skinned meshes in the core's axes.
        chains: those that were found.
    """
    found = [leaf(stage_rig.joints.names[joint]) for joint in left_out(stage_rig.character, meshes, chains)]
    if not found:
        return []
    what, they = f"'{found[0]}' is", "it is"
    if found[1:]:
        what, they = f"'{found[0]}' and {len(found) - 1} more are", "they are"
    return [f"{stage_rig.path}: {what} not moved; if {they} hair, name all that is to move with --chains"]


def unnamed_notes(stage_rig: StageRig, meshes: list[Body], strands: bool) -> list[str]:
    """The note on joints below the head that drive skin, if none was recognised as hair, and why.

    Args:
        stage_rig: the character.
        meshes: its skinned meshes in the core's axes.
        strands: its stage has hair of another kind, so that only what looks much like a chain is worth a note.
    """
    own = stage_rig.character.own_names
    found = left_out(stage_rig.character, meshes, least=UNNAMED if strands else 1)
    found = [joint for joint in found if not (strands and says_face(own[joint]))]
    if not found:
        return []
    first, body = leaf(stage_rig.joints.names[found[0]]), of_the_body(stage_rig.character, meshes)
    what, they = f"'{first}' drives", "it is"
    if found[1:]:
        what, they = f"'{first}' and {len(found) - 1} more drive", "they are"
    why = "the body drives that mesh, too" if body[found[0]] else "it is a single joint"
    why = "it is named like what a face has or wears" if says_face(own[found[0]]) else why
    return [
        f"{stage_rig.path}: {what} skin below the head, but no name says hair and {why}; if {they} hair, name all that is to move in "
        f"neuralocks rig inspect and rig train, with --chains {first}"
    ]
