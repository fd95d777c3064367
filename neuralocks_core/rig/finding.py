# SPDX-License-Identifier: Apache-2.0
"""Finding the hair chains of a rig: what hangs below the head and drives no body mesh."""

import fnmatch
import re
from dataclasses import dataclass

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rotation import rotation_part

HAIR_WORDS = (
    "hair|pony|braid|bang|fringe|tress|strand|lock|curl|pigtail|twintail|ahoge|kami|mane|plait|dread|bun|forelock"
    "|sideburn|tuft"
)
FACE_WORDS = (
    "eye|lid|brow|jaw|tongue|teeth|tooth|lip|mouth|cheek|nose|nostril|chin|face|facial|lash|ear|earring|temple|forehead|pupil|iris"
    "|oris|risorius|levator|special|orbicularis|squint|beard|glass|hat|crown|helmet|horn"
)
_HAIR_PARTS = ("hair", "pigtail", "twintail", "sidetail", "髪", "アホ毛", "おさげ", "ツインテ", "ポニテ", "もみあげ")
"""Hair wherever in a name they stand; the last ones are those of MikuMikuDance rigs, in files with UTF-8 names."""
_NO_BONE = 1e-5
"""Shorter bones [m] have no direction."""
_FEW = 1e-3
"""Skin weight below which a joint does not drive a vertex."""


@dataclass(frozen=True)
class SkinnedMesh:
    """One skinned mesh of a rig.

    Attributes:
        name: for messages.
        points: bind pose, world space, (V, 3) [m].
        triangles: (F, 3) int.
        joint_indices: indices in the skeleton, (V, I) int.
        joint_weights: (V, I), each row sums to one.
    """

    name: str
    points: np.ndarray
    triangles: np.ndarray
    joint_indices: np.ndarray
    joint_weights: np.ndarray

    def weight_on(self, joints: np.ndarray) -> np.ndarray:
        """Sum of each vertex's weights (V,) on the joints of a mask (J,)."""
        return np.sum(self.joint_weights * joints[self.joint_indices], axis=1)

    def driven_by(self, joint_count: int) -> np.ndarray:
        """Which joints (J,) drive any of its vertices."""
        used = np.zeros(joint_count, bool)
        used[self.joint_indices[self.joint_weights > _FEW]] = True
        return used


def find_chains(
    character: Character, meshes: list[SkinnedMesh] | None = None, patterns: list[str] | None = None
) -> HairChains:
    """The hair chains of a character.

    Without patterns, a subtree below the head is hair if its joints are named like hair, or if they are not
    named like a face and drive no mesh that a joint outside the head drives too. With patterns (shell
    wildcards, matched against joint paths and their last parts) it is hair if its first joint matches.

    Args:
        character: skeleton and head.
        meshes: the skinned meshes; without them only names decide and free ends are bones without a joint of their own.
        patterns: names by hand.

    Raises:
        NeuralocksError: there are none, a bone has no length, or a joint is mirrored or unevenly scaled.
    """
    skeleton, head = character.skeleton, character.head
    children = [[] for _ in skeleton.names]
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            children[parent].append(joint)
    below = _below(head, skeleton.parents)
    tops = _by_pattern(character, below, patterns) if patterns else _by_itself(character, children, below, meshes)
    if not tops:
        others = ", ".join(_leaf(skeleton.names[j]) for j in children[head][:8]) or "nothing"
        raise NeuralocksError(
            f"skeleton: no hair chains below '{_leaf(skeleton.names[head])}' (it carries {others}); "
            "name them with --chains PATTERN, or the joint that carries them with --head JOINT"
        )
    return _measured(character, children, sorted(tops), meshes)


def split_meshes(meshes: list[SkinnedMesh], skeleton_parents: np.ndarray, head: int, moving: np.ndarray):
    """Which triangles are body and which vertices are hair.

    A mesh that moving joints drive and nothing outside the head's subtree does is hair as a whole, with the cap
    that is tied to the head; in one that is both, triangles that a moving joint touches are hair.

    Returns:
        for each mesh (triangles of the body (F', 3), mask of hair vertices that move (V,)).
    """
    below = _below(head, skeleton_parents)
    below[head] = True
    result = []
    for mesh in meshes:
        moved = mesh.weight_on(moving) > _FEW
        if moved.any() and not (mesh.driven_by(len(below)) & ~below).any() and moved.mean() > 0.2:
            result.append((np.zeros((0, 3), int), moved))
        else:
            result.append((mesh.triangles[~moved[mesh.triangles].any(axis=1)], moved))
    return result


def _by_pattern(character, below, patterns) -> list[int]:
    names, parents = character.skeleton.names, character.skeleton.parents
    hits = [
        joint
        for joint, name in enumerate(names)
        if any(fnmatch.fnmatchcase(name, p) or fnmatch.fnmatchcase(_leaf(name), p) for p in patterns)
    ]
    if not hits:
        raise NeuralocksError(
            f"--chains {' '.join(patterns)}: no joint has such a name; see neuralocks inspect for their names"
        )
    outside = [joint for joint in hits if not below[joint]]
    if outside:
        raise NeuralocksError(
            f"--chains: joint '{_leaf(names[outside[0]])}' does not hang below the head joint "
            f"'{_leaf(names[character.head])}'; use a narrower pattern or another --head"
        )
    chosen = np.zeros(len(names), bool)
    chosen[hits] = True
    return [joint for joint in hits if not _any_above(joint, parents, chosen)]


def _by_itself(character, children, below, meshes) -> list[int]:
    names, parents = character.skeleton.names, character.skeleton.parents
    used = np.zeros(len(names), bool)
    body = np.zeros(len(names), bool)
    outside = ~below
    outside[character.head] = False
    for mesh in meshes or ():
        drives = mesh.driven_by(len(names))
        used |= drives
        if (drives & outside).any():
            body |= drives
    tops, todo = [], list(children[character.head])
    while todo:
        joint = todo.pop()
        tree = [j for j in range(len(names)) if j == joint or _is_above(joint, j, parents)]
        if _named(names[joint], FACE_WORDS) and not _named(names[joint], HAIR_WORDS):
            continue
        if meshes and not used[tree].any():
            continue
        hair = _named(names[joint], HAIR_WORDS)
        # A holder that drives nothing is no bone of hair: its children are. Without meshes only a fan tells.
        if (not used[joint] and children[joint]) if meshes else len(children[joint]) > 1:
            todo += children[joint]
            continue
        strange = len(tree) > 1 and meshes and not body[tree].any() and not _any_named(names, tree, FACE_WORDS)
        if hair or strange:
            tops.append(joint)
        else:
            todo += children[joint]
    return tops


def _measured(character, children, tops, meshes) -> HairChains:
    skeleton = character.skeleton
    places = character.canonical(skeleton.bind[:, :3, 3])
    order, stack = [], list(reversed(tops))
    while stack:
        joint = stack.pop()
        order.append(joint)
        stack += reversed(children[joint])
    order.sort()
    carries = _carrying(character, order, meshes)
    rows, free = {}, {}
    for joint in order:
        end = None if children[joint] else _free_end(character, joint, joint in tops, meshes, places)
        if children[joint] and joint in carries or end is not None:
            rows[joint] = len(rows)
            free[joint] = end
    if not rows:
        raise NeuralocksError(
            f"skeleton: hair joint '{_leaf(skeleton.names[tops[0]])}' drives no vertices and has no child; "
            "skin the hair to its joints or choose others with --chains"
        )
    bone_joint, bone_end, bones = [], [], []
    for joint, row in rows.items():
        ends = [(rows.get(child, -1), places[child]) for child in children[joint]] or [(-1, free[joint])]
        for end, place in ends:
            if np.linalg.norm(place - places[joint]) < _NO_BONE:
                child = next((_leaf(skeleton.names[c]) for c in children[joint]), "its end")
                raise NeuralocksError(
                    f"skeleton: hair bone '{_leaf(skeleton.names[joint])}' has no length ('{child}' lies at the same place); "
                    "move or remove one of the two, or leave the chain out with --chains"
                )
            bone_joint.append(row)
            bone_end.append(end)
            bones.append(place - places[joint])
    joints = np.array(list(rows), int)
    names = [_leaf(skeleton.names[j]) for j in joints]
    double = next((n for n in names if names.count(n) > 1), None)
    if double:
        raise NeuralocksError(f"skeleton: two hair joints are named '{double}'; give them names of their own")
    parents = np.array([rows.get(int(skeleton.parents[j]), -1) if j not in tops else -1 for j in joints], int)
    chain = np.zeros(len(joints), int)
    for row, parent in enumerate(parents):
        chain[row] = chain[parent] if parent >= 0 else (parents[:row] < 0).sum()
    _check_scale(skeleton, joints)
    axes = character.bind_to_canonical[:3, :3] @ rotation_part(skeleton.bind[joints], "hair joint in bind pose")
    return HairChains(names, joints, parents, chain, places[joints], axes, bone_joint, bone_end, np.array(bones))


def _carrying(character, order, meshes) -> set[int]:
    """Those of these joints that drive skin or have skin further down: end joints may have ends of their own, which
    exporters add. All of them where none drives any, as in a rig that nobody has skinned yet.
    """
    parents = character.skeleton.parents
    used = np.zeros(len(parents), bool)
    for mesh in meshes or ():
        used |= mesh.driven_by(len(parents))
    carries = set()
    for joint in order:
        up = joint if used[joint] else -1
        while up >= 0 and up not in carries:
            carries.add(up)
            up = int(parents[up])
    return carries if carries else set(order)


def _free_end(character, joint, is_top, meshes, places) -> np.ndarray | None:
    """Where the bone of a last joint ends: as far as its skin reaches. None if it drives nothing, that is, if it
    is an end marker.
    """
    parent = int(character.skeleton.parents[joint])
    points = [
        mesh.points[np.sum(mesh.joint_weights * (mesh.joint_indices == joint), axis=1) > 0.3] for mesh in meshes or ()
    ]
    points = np.concatenate(points) if points else np.zeros((0, 3))
    if not len(points):
        return None
    reach = character.canonical(points) - places[joint]
    along = reach.mean(axis=0) if is_top else places[joint] - places[parent]
    size = np.linalg.norm(along)
    if size < _NO_BONE:
        return None
    along = along / size
    length = float((reach @ along).max())
    # Skin that hardly passes the joint belongs to the bone before it: the joint is that bone's end.
    if length < (0.01 if is_top else 0.2 * size):
        return None
    return places[joint] + length * along


def _check_scale(skeleton, joints) -> None:
    for joint in joints:
        linear = skeleton.bind[joint, :3, :3]
        name, scale = _leaf(skeleton.names[joint]), np.linalg.norm(linear, axis=0)
        if np.linalg.det(linear) < 0:
            raise NeuralocksError(
                f"hair joint '{name}': mirrored in bind pose (negative scale); apply the scale in the rig"
            )
        if scale.min() < 1e-9 or scale.max() > 1.01 * scale.min():
            raise NeuralocksError(
                f"hair joint '{name}': unevenly scaled in bind pose {np.round(scale, 3)}; apply the scale in the rig"
            )


def _leaf(name: str) -> str:
    return name.rsplit("/", 1)[-1]


def _named(name: str, words: str) -> bool:
    """Whether a part of the name begins with one of the words; `earring` is no hair, `Hair_L.001`, `frontHair2` and
    `PigTail_L` are.
    """
    name = _leaf(name).rsplit(":", 1)[-1]
    parts = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)
    return any(re.match(f"(?:{words})", part.lower()) for part in parts) or (
        words is HAIR_WORDS and any(part in name.lower().replace("_", "") for part in _HAIR_PARTS)
    )


def _any_named(names, joints, words) -> bool:
    return any(_named(names[j], words) for j in joints)


def _below(joint: int, parents) -> np.ndarray:
    mask = np.zeros(len(parents), bool)
    for j, parent in enumerate(parents):
        mask[j] = parent >= 0 and (parent == joint or mask[parent])
    return mask


def _is_above(joint: int, other: int, parents) -> bool:
    while other >= 0:
        other = int(parents[other])
        if other == joint:
            return True
    return False


def _any_above(joint: int, parents, mask) -> bool:
    joint = int(parents[joint])
    while joint >= 0:
        if mask[joint]:
            return True
        joint = int(parents[joint])
    return False
