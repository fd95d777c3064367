# SPDX-License-Identifier: GPL-3.0-or-later
"""How the head stood in each frame when hair was baked, stored with the bake, so that the panel sees when the animation was changed
afterwards: also after the file was opened again, and without sampling the motion again.
"""

import numpy as np

from ..session import SampledRig, session
from .armature import matrix
from .shown import shown_frame

KEY = "neuralocks_heads"
"""The property of a cache file, or of an action with hair keys, that stores it."""
MOST = 2000
"""Most frames that are stored."""
NEAR = 1e-3
"""Transforms of the head that differ by less (in matrix entries) are the same pose."""


def remember(block, armature) -> None:
    """Store with a bake how the head of this armature stands in the whole frames of the motion that was sampled for it."""
    sampled = session.rigs.get(armature.name_full) if armature is not None else None
    if sampled is None:
        block.pop(KEY, None)
        return
    frames, head = sampled.motion.frames, sampled.character.head
    whole = np.flatnonzero(frames % 1 == 0)[:MOST]
    block[KEY] = {
        "bone": sampled.rig.bones[head],
        "first": int(frames[whole[0]]),
        "heads": _stood(sampled, head)[whole].ravel().tolist(),
    }


def moved_since(block, armature, scene) -> bool:
    """Whether the head of this armature is drawn elsewhere in the shown frame than when the hair was baked; not if that is unknown."""
    told, frame = block.get(KEY), shown_frame(scene)
    bone = armature.pose.bones.get(told["bone"]) if told and armature.visible_get() else None
    row = round(frame) - told["first"] if bone is not None else -1
    stood = np.array(told["heads"]).reshape(-1, 3, 4) if told else ()
    if not 0 <= row < len(stood) or abs(frame - round(frame)) > NEAR:
        return False
    here = matrix(armature.matrix_world @ bone.matrix)[:3]
    return bool((np.abs(here - stood[row]) > NEAR * (1 + np.abs(stood[row]))).any())


def _stood(sampled: SampledRig, joint: int) -> np.ndarray:
    """World transforms (T, 3, 4) of a joint as Blender gave them."""
    return (sampled.drawn[:, joint].astype(float) @ np.linalg.inv(sampled.trim[joint]))[:, :3]
