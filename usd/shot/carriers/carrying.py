# SPDX-License-Identifier: Apache-2.0
"""Which joint of a rig carries hair, by what the hair's prim follows or by the skin under it; and the character with that joint."""

from dataclasses import replace

import numpy as np

from neuralocks_core.anatomy.humanoid import Humanoid, NoHead, find_humanoid
from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character
from neuralocks_core.rotation import flat

from ...border.placement import Placement
from ...skel.stage_rig import StageRig
from ...skel.surface import moved_joints
from .seat import some_places

STILL = 1e-4
"""What moves by less than this [m], and turns by less, relative to something moves with it."""
MOST = 0.75
"""Share of the skin under a groom that must follow its joint, or the rest of it visibly leaves the skin."""


def carrying_joint(rig: StageRig, shares: np.ndarray, exact: bool = False) -> tuple[int, str]:
    """The joint that carries, and why: the head if most of the skin follows it or a joint below it."""
    names = rig.joints.names
    best = int(shares.argmax())
    head = rig.character.humanoid.get("head")
    if head is not None and best != head:
        below = rig.character.of_head
        single = shares[best] > (0.95 if exact else 0.8)
        if below[best] and (not single or _rides_along(rig, best, head)) or not single and shares[below].sum() > 0.5:
            return head, f"joint '{names[head]}'"
    return best, f"joint '{names[best]}'"


def followed_joint(rig: StageRig, placement: Placement) -> tuple[int, np.ndarray] | None:
    """The head, or the joint below it, that a prim's own animated transform follows, as for hair parented to a bone, and the prim's
    transform to bind world (4, 4) [m]. None if it follows none, or other joints too, as when the whole character moves as one.
    """
    head, character = rig.character.humanoid.get("head"), rig.character
    if head is None or not placement.samples:
        return None
    rows, places = some_places(rig, placement)
    if not len(rows):
        return None
    below, joints = character.of_head, rig.clip.joints[rows]
    seen = ~flat(joints[..., :3, :3]).any(axis=0)  # what a scale of zero hides carries no hair
    others = np.flatnonzero(seen & ~below)
    if _still(places) or any(_still(np.linalg.inv(joints[:, joint]) @ places) for joint in others):
        return None
    for joint in np.flatnonzero(seen & below):  # parents come first
        way = character.skeleton.bind[joint] @ np.linalg.inv(joints[:, joint]) @ places
        if _still(way):
            return int(joint), way[0]
    return None


def _still(places: np.ndarray) -> bool:
    """Whether transforms (T, 4, 4) to metres are all the same."""
    turned, moved = (np.ptp(places[:, :3, part], axis=0).max() for part in (slice(3), 3))
    return bool(moved < STILL and turned < STILL * np.abs(places[:, :3, :3]).max())


def joint_shares(rig: StageRig, indices: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Share (J,) of each joint in these influences."""
    shares = np.bincount(indices.ravel(), weights.ravel(), len(rig.joints.names))
    return shares / max(shares.sum(), 1e-12)


def carried_by(rig: StageRig, joint: int) -> Character:
    """The rig's character with the joint that carries a groom: its head, one below it, or one that takes its role. The same object
    for all grooms of that joint.
    """
    if joint not in rig.carried:
        rig.carried[joint] = _carried_by(rig, joint)
    return rig.carried[joint]


def _carried_by(rig: StageRig, joint: int) -> Character:
    head, skeleton = rig.character.humanoid.get("head"), rig.character.skeleton
    if head == joint:
        return rig.character
    below = head is not None and rig.character.of_head[joint]
    # If the user calls the neck the head, the head found by name does not become a part of it.
    if below and not ("head" in rig.by_hand and joint == head_by_name(rig)):
        return replace(rig.character, carrier=joint)
    return replace(rig.character, humanoid=_humanoid(rig, head=skeleton.names[joint]))


def spread_over(rig: StageRig, path: str, joint: int, shares: np.ndarray) -> list[str]:
    """The note on hair that one joint cannot carry: fur all over a body."""
    names = [leaf(name) for name in rig.joints.names]
    # Joints below a head are its face; joints below a spine are everything.
    own = rig.character.of_head if joint == rig.character.humanoid.get("head") else np.arange(len(names)) == joint
    share = shares[own].sum()
    if share >= MOST:
        return []
    rest = np.where(own, 0, shares)
    others = [names[other] for other in np.argsort(-rest, kind="stable")[:3] if rest[other] > 0.02]
    return [
        f"{path}: only {share:.0%} of its roots move with joint '{names[joint]}', which carries all of it; the others "
        f"({', '.join(others)}) will leave the skin: split the groom by joint"
    ]


def head_by_name(rig: StageRig) -> int | None:
    """The head by name, whatever the user gave."""
    try:
        return _humanoid(rig)["head"]
    except NoHead:
        return None


def _rides_along(rig: StageRig, joint: int, head: int) -> bool:
    """Whether a joint below the head never moves relative to it, as long as no scale of zero hides that."""
    joints = rig.clip.joints[~flat(rig.clip.joints[:, head, :3, :3])]
    return _still(np.linalg.inv(joints[:, head]) @ joints[:, joint])


def _humanoid(rig: StageRig, **head: str) -> Humanoid:
    skeleton = rig.character.skeleton
    by_hand = {name: joint for name, joint in rig.by_hand.items() if name != "head"} | head
    skinned = moved_joints(rig.meshes, len(skeleton.names))
    return find_humanoid(skeleton.names, skeleton.parents, skeleton.bind[:, :3, 3], by_hand, skinned)
