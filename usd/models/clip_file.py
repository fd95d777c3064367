# SPDX-License-Identifier: Apache-2.0
"""Motion of a file, on the character that is to learn from it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from pxr import UsdSkel

from neuralocks_core.anatomy.humanoid import Humanoid
from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.animation.cuts import find_cuts
from neuralocks_core.animation.retarget import retarget
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats.bvh import Motion, read_bvh
from neuralocks_core.motion import Clip

from ..border.damage import names_damage
from ..border.stage_files import open_stage
from ..border.units import Border
from ..border.values import as_names
from ..shot.characters.skeletons import read_each_rig
from ..shot.notes.missing import nothing_found
from ..shot.notes.motion_notes import motion_notes
from ..shot.notes.skeleton_notes import without_turn
from ..skel.source import find_skeletons
from ..skel.stage_rig import StageRig

ELSEWHERE = 0.01
"""Joints of a motion's skeleton lie where the character's do, if they are nearer than this share of its height."""


@names_damage
def read_clip(path: str, character: Character, notes: list[str] | None = None, beside: Border | None = None) -> Clip:
    """Motion of a file on a character: BVH is retargeted; a USD skeleton must have the same joints, and is retargeted if they lie
    elsewhere.

    Args:
        path: the file.
        character: who is to move.
        notes: what a user should know is added here.
        beside: of the character's stage, for what a USD file does not tell of its unit and axis.

    Raises:
        NeuralocksError: it holds no such motion.
    """
    if Path(path).suffix.lower() == ".bvh":
        captured = read_bvh(path)
        clip = _retargeted(replace(captured, name=str(path)), character)
        if notes is not None:
            notes += motion_notes(captured, clip.joints, character.humanoid)
        return clip
    stage, names = open_stage(path), character.skeleton.names
    prims = find_skeletons(stage)
    if not prims:
        raise nothing_found(stage, Path(path), "UsdSkel skeleton", "give motion of the character's joints, or BVH")
    listed = [UsdSkel.Skeleton(prim).GetJointsAttr() for prim in prims]
    alike = [prim for prim, joints in zip(prims, listed) if as_names(joints, joints.Get()) == names]
    if not alike:
        raise NeuralocksError(f"{path}: its skeleton is not the character's; give motion of the same joints, or BVH")
    # What a file does not tell is either USD's own or, as exporters leave it out, the character's: its bind pose says which.
    borders = dict.fromkeys([Border.of(stage)] if beside is None else [Border.of(stage), beside.unless_told(stage)])
    read = [read_each_rig(stage, alike, border, names[character.head], all_shapes=True) for border in borders]
    rigs, errors = min(read, key=lambda each: min((_apart(character, rig).max() for rig in each[0]), default=np.inf))
    if not rigs:
        raise NeuralocksError(f"{path}: {errors[0]}")
    moving = [rig for rig in rigs if len(rig.clip.times) > 1]
    if not moving:
        raise NeuralocksError(f"{path}: its skeleton has no animation; give a moving one")
    if notes is not None and len(moving) > 1:
        notes.append(
            f"{Path(path).name}: {moving[0].path} is learned from, and not the other {len(moving) - 1} that move in it, such as "
            f"{moving[1].path}; give each a file of its own"
        )
    if stops := without_turn(moving[0]):
        raise NeuralocksError(f"{path}: {stops[0]}")
    return _on(character, moving[0], Path(path), notes)


def _on(character: Character, mover: StageRig, path: Path, notes: list[str] | None) -> Clip:
    """The clip of another file's skeleton on a character that has the same joints, though perhaps in other places or axes."""
    clip, ours = mover.clip, character.skeleton.bind
    apart = _apart(character, mover)
    if apart.max() <= ELSEWHERE * np.ptp(ours[:, 1, 3]):
        return replace(clip, joints=clip.joints @ mover.character.inverse_bind @ ours)
    if notes is not None:
        furthest = leaf(character.skeleton.names[apart.argmax()])
        notes.append(
            f"{path}: its bind pose is not the character's ('{furthest}' is {apart.max():.2g} m elsewhere), so the motion is "
            "retargeted, as a BVH's is"
        )
    return _retargeted(Motion(str(path), mover.character.skeleton, clip, 1.0), character, character.humanoid)


def _retargeted(motion: Motion, character: Character, humanoid: Humanoid | None = None) -> Clip:
    """The motion on the character, with its cuts: where two takes were joined, or a T-pose leads in, nobody flew through the room."""
    clip = retarget(motion, character, humanoid)
    return replace(clip, cuts=find_cuts(clip, character.head))


def _apart(character: Character, mover: StageRig) -> np.ndarray:
    """How far each joint (J,) of another file's skeleton lies from the character's in the bind pose [m]."""
    return np.linalg.norm(mover.character.skeleton.bind[:, :3, 3] - character.skeleton.bind[:, :3, 3], axis=1)
