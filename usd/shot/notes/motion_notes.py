# SPDX-License-Identifier: Apache-2.0
"""Notes on motion capture: what had to be guessed, and whether its performer lies down."""

import numpy as np

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.anatomy.upright import mostly_lies
from neuralocks_core.formats.bvh import Motion


def motion_notes(motion: Motion, joints: np.ndarray, humanoid: Humanoid) -> list[str]:
    """Notes on a BVH file.

    Args:
        motion: from the file.
        joints: the motion's world transforms (T, J, 4, 4), Y up, on the character that it moves.
        humanoid: which of these joints are which.
    """
    notes = []
    if motion.guessed:
        notes.append(
            f"{motion.name}.bvh: its pose with zero rotations stands along no axis, so which way is up is taken from the motion; "
            "if joints look twisted, export it with a T-pose as rest pose"
        )
    if mostly_lies(joints, humanoid):
        notes.append(
            f"{motion.name}.bvh: its performer lies in most frames; if it should stand, export it with Y up and a T-pose as rest "
            "pose"
        )
    return notes
