# SPDX-License-Identifier: Apache-2.0
"""What a user should know about a character with hair on joints: its weights, which joints are found, which chains are taken."""

import numpy as np

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.rig.carried import moved_between
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.network import rig_spec

from ..shot.notes.character_notes import lies_down, weight_notes
from ..shot.notes.skeleton_notes import another_head, unfound, unlikely_head
from ..skel.stage_rig import StageRig
from .facing import askew_notes
from .stage import RiggedHair, core_meshes
from .unmoved_joints import left_out_notes, outside_notes

RIG_JOINTS = rig_spec().pose_joints
"""Semantic joints that rig models read besides the head."""


def rigged_notes(stage_rig: StageRig, pose_joints=RIG_JOINTS) -> list[str]:
    """What a user should know about a character with hair on joints.

    Args:
        stage_rig: the character.
        pose_joints: semantic joints that the network reads besides the head.
    """
    found = [
        *unfound(stage_rig, pose_joints),
        *unlikely_head(stage_rig),
        *another_head(stage_rig),
        *lies_down(stage_rig),
    ]
    frames = stage_rig.border.frame_notes(stage_rig.path)
    return [
        *stage_rig.notes,
        *frames,
        *weight_notes(stage_rig),
        *askew_notes(stage_rig),
        *outside_notes(stage_rig),
        *found,
    ]


def chain_notes(hair: RiggedHair, patterns: list[str] | None) -> list[str]:
    """What a user should know about automatically chosen chains; those chosen by patterns are the user's own."""
    return [] if patterns else left_out_notes(hair.stage_rig, core_meshes(hair.stage_rig), hair.rig.chains)


def mirrored_notes(stage_rig: StageRig, chains: HairChains) -> list[str]:
    """Which hair joint, or joint that carries one, the animation mirrors; what hangs from it is mirrored alike."""
    joints = np.unique(np.concatenate([chains.joints, stage_rig.joints.parents[chains.joints]]))
    flipped = (np.linalg.det(stage_rig.clip.joints[:, joints, :3, :3]) < 0).any(axis=0)
    if not flipped.any():
        return []
    name = leaf(stage_rig.joints.names[joints[np.argmax(flipped)]])
    return [f"{stage_rig.path}: hair joint '{name}' is mirrored by its animation; remove the negative scale"]


def offset_notes(stage_rig: StageRig, chains: HairChains) -> list[str]:
    """The note on joints between hair joints that the animation moves, since hair then moves with them besides its turns."""
    found = [
        leaf(stage_rig.joints.names[joint]) for joint in moved_between(chains, stage_rig.character, stage_rig.clip)
    ]
    if not found:
        return []
    what, they = f"'{found[0]}' is animated and moves", "its keys"
    if found[1:]:
        what, they = f"'{found[0]}' and {len(found) - 1} more are animated and move", "their keys"
    return [f"{stage_rig.path}: {what} hair besides the network; clear {they} unless that is wanted"]
