# SPDX-License-Identifier: Apache-2.0
"""Motion of one skeleton on another: a BVH clip on any character."""

from __future__ import annotations

import numpy as np

from neuralocks_core import rotation
from neuralocks_core.anatomy.humanoid import TRUNK, Humanoid, NoHead
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError, about
from neuralocks_core.formats.bvh import Motion
from neuralocks_core.motion import Clip

LIMBS = {
    "shoulder": None,
    "upper_arm": ("upper_arm", "lower_arm"),
    "lower_arm": ("lower_arm", "hand"),
    "hand": ("lower_arm", "hand"),
    "upper_leg": ("upper_leg", "lower_leg"),
    "lower_leg": ("lower_leg", "foot"),
    "foot": None,
}
"""Limb joint -> ends of the bone that is aligned between the rest poses (a hand extends the forearm).

If None, both rest poses are assumed to agree: soles lie flat in both.
"""


def retarget(motion: Motion, character: Character, humanoid: Humanoid | None = None) -> Clip:
    """Put a motion on a character.

    Each joint gets the source's rotation from its rest pose, after the character's bone is turned from its bind
    direction to the source's rest direction, so that T-poses, A-poses and hanging arms can be mixed. The hips travel in
    proportion to the length of the legs, start over the origin, and the lowest foot of the clip stands on the floor.

    Args:
        motion: from `formats.bvh.read_bvh`.
        character: who will move; Y up, feet on Y = 0 in bind pose.
        humanoid: the source's joints by meaning; found by name if left out.

    Raises:
        NeuralocksError: no joint of the source is named like a head.
    """
    with about(motion.name):
        try:
            source = Character(motion.skeleton, humanoid=humanoid)
        except NoHead:  # --head and --joint name the character's
            raise NeuralocksError("no joint is named like a head; rename it in the file, to Head") from None
    turns = _turns(motion, source, character)
    joints = _posed(turns, character, len(motion.clip.times))
    joints[..., :3, 3] += _travel(motion, source, character, joints)[:, None]
    return Clip(motion.clip.times, joints)


def _turns(motion: Motion, source: Character, character: Character) -> dict[int, np.ndarray]:
    """World rotations (T, 3, 3) from the bind pose per joint of the character, canonical axes."""
    moved = source.relative_rotations(motion.clip.joints, np.arange(len(source.skeleton.names)))
    moved = source.facing @ moved  # so far only relative to the bind pose; now in axes that face +Z
    found: dict[str, np.ndarray] = {}
    for name in TRUNK:
        if name in source.humanoid:
            found[name] = moved[:, source.humanoid[name]]
    if motion.guessed:
        for name, ends in _trunk_bones(source, character):
            found[name] = found[name] @ _alignment(source, character, ends)
    found = _trunk_between(found)
    for side in ("left", "right"):
        for part, ends in LIMBS.items():
            name = f"{side}_{part}"
            if name in source.humanoid and name in character.humanoid:
                bone = None if ends is None else [f"{side}_{end}" for end in ends]
                found[name] = moved[:, source.humanoid[name]] @ _alignment(source, character, bone)
    result: dict[int, np.ndarray] = {}
    for name in (*TRUNK, *(n for n in found if n not in TRUNK)):
        if name in character.humanoid and name in found:
            result.setdefault(character.humanoid[name], found[name])
    return result


def _trunk_bones(source: Character, character: Character) -> list[tuple[str, list[str]]]:
    """Joints between hips and head, each with the ends of its bone: a rest pose found in a motion has a straight trunk."""
    shared = [name for name in TRUNK if name in source.humanoid and name in character.humanoid]
    return [(below, [below, above]) for below, above in zip(shared[1:], shared[2:])]


def _trunk_between(found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Trunk joints that the source lacks, half way between their neighbours."""
    if "hips" not in found or "head" not in found:
        raise NeuralocksError("motion: its skeleton has no hips or no head; rename its joints")
    result = dict(found)
    for i, name in enumerate(TRUNK):
        if name not in found:
            below = next(result[n] for n in reversed(TRUNK[:i]) if n in result)
            above = next(found[n] for n in TRUNK[i:] if n in found)
            between = rotation.to_vector(np.swapaxes(below, -1, -2) @ above)
            result[name] = below @ rotation.from_vector(0.5 * between)
    return result


def _alignment(source: Character, character: Character, ends: list[str] | None) -> np.ndarray:
    """Rotation (3, 3), canonical axes, from the character's bone in bind pose to the source's at rest."""
    directions = []
    for who in (character, source):
        if ends is None or any(end not in who.humanoid for end in ends):
            return np.eye(3)
        first, last = (who.skeleton.bind[who.humanoid[end], :3, 3] for end in ends)
        if np.linalg.norm(last - first) < 1e-6:
            return np.eye(3)
        directions.append(who.facing @ (last - first))
    return rotation.between(*directions)


def _posed(turns: dict[int, np.ndarray], character: Character, count: int) -> np.ndarray:
    """World transforms (T, J, 4, 4) with the hips at their bind place; joints without a turn follow their parent."""
    skeleton, facing = character.skeleton, character.facing
    bind = skeleton.bind[:, :3, 3]
    turned = np.tile(np.eye(3), (count, len(skeleton.names), 1, 1))
    joints = np.tile(np.eye(4), (count, len(skeleton.names), 1, 1))
    for joint, parent in enumerate(skeleton.parents):
        if joint in turns:
            turned[:, joint] = facing.T @ turns[joint] @ facing
        elif parent >= 0:
            turned[:, joint] = turned[:, parent]
        joints[:, joint, :3, 3] = bind[joint]
        if parent >= 0:
            joints[:, joint, :3, 3] = joints[:, parent, :3, 3] + turned[:, parent] @ (bind[joint] - bind[parent])
        joints[:, joint, :3, :3] = turned[:, joint] @ skeleton.bind[joint, :3, :3]
    return joints


def _travel(motion: Motion, source: Character, character: Character, joints: np.ndarray) -> np.ndarray:
    """Shift (T, 3) [m] of the whole posed character."""
    ratio = _leg_length(character.skeleton, character.humanoid) / _leg_length(source.skeleton, source.humanoid)
    hips = motion.clip.joints[:, source.humanoid["hips"], :3, 3] @ source.facing.T @ character.facing
    shift = ratio * (hips - hips[0] * [1, 0, 1])
    shift -= character.skeleton.bind[character.humanoid["hips"], :3, 3] * [0, 1, 0]
    feet = [character.humanoid[f"{s}_foot"] for s in ("left", "right") if f"{s}_foot" in character.humanoid]
    below = [j for j in range(len(character.skeleton.names)) if character.skeleton.parents[j] in feet]
    soles = feet + below
    if soles:
        over = joints[:, soles, 1, 3] + shift[:, None, 1] - character.skeleton.bind[soles, 1, 3]
        # The lowest few of all frames: single bad frames do not lift the whole clip.
        shift[:, 1] -= np.percentile(over.min(axis=1), 5)
    return shift


def _leg_length(skeleton: Skeleton, humanoid: Humanoid) -> float:
    """Length from hip to foot along the bones [m], or a share of the height if the rig has no legs."""
    bind = skeleton.bind[:, :3, 3]
    lengths = []
    for side in ("left", "right"):
        chain = [humanoid.get(f"{side}_{part}") for part in ("upper_leg", "lower_leg", "foot")]
        if None not in chain:
            lengths.append(np.linalg.norm(np.diff(bind[chain], axis=0), axis=1).sum())
    if lengths and np.mean(lengths) > 1e-3:
        return float(np.mean(lengths))
    return 0.5 * max(float(np.ptp(bind[:, 1])), 1e-3)
