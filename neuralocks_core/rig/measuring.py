# SPDX-License-Identifier: Apache-2.0
"""Measuring hair joints: which of them move, where their bones end, and how they lie in the bind pose."""

from dataclasses import replace

import numpy as np

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.skinned_mesh import SkinnedMesh
from neuralocks_core.rotation import rotation_part

NO_BONE = 1e-5
"""Shorter bones [m] have no direction."""
DRIVEN = 0.3
"""Skin on which a joint has more than this weight determines how far its bone reaches."""
UNEVEN = 1.01
"""Joints scaled this many times more along one axis than along another are refused."""
ASTRAY, COVERED = 0.5, 0.5
"""An end marker is not believed if the cosine of its angle to the skin and to the bone before is smaller, and the skin reaches less
than this share of the way to it.
"""
SHORT, SHORT_AFTER = 0.01, 0.2
"""Skin that extends past a last joint by less than this is not a bone of its own: for a chain of one joint in [m], for others in
lengths of the bone before."""


class UnevenJoint(NeuralocksError):
    """A hair joint is scaled more along one axis than along another."""


def measured_chains(character: Character, tops: list[int], meshes: list[SkinnedMesh] | None) -> HairChains:
    """The chains that begin at these joints.

    Args:
        character: whose skeleton they are in.
        tops: first joints of the subtrees, ascending.
        meshes: the skinned meshes, which tell where free ends are.

    Raises:
        NeuralocksError: no joint moves, a bone has no length, two hair joints share a name, a chain's first joint has the
            name of another joint below the head, or a joint is mirrored or unevenly scaled.
    """
    skeleton = character.skeleton
    places = character.canonical(skeleton.bind[:, :3, 3])
    rows, free, ends = _moving(character, tops, meshes, places)
    if not rows:
        raise NeuralocksError(
            f"skeleton: hair joint '{leaf(skeleton.names[tops[0]])}' drives no vertices and has no child; "
            "skin the hair to its joints or choose others with --chains"
        )
    bone_joint, bone_end, bones = _bones(skeleton, rows, free, ends, places)
    joints = np.array(list(rows), int)
    names = [leaf(skeleton.names[j]) for j in joints]
    double = next((n for n in names if names.count(n) > 1), None)
    if double:
        raise NeuralocksError(f"skeleton: two hair joints are named '{double}'; give each its own name")
    # A model tells joints with the same name apart by their parents, except for the first of a chain.
    below = [leaf(skeleton.names[j]) for j in np.flatnonzero(character.of_head)]
    double = next((name for name, j in zip(names, joints) if j in tops and below.count(name) > 1), None)
    if double:
        raise NeuralocksError(
            f"skeleton: {below.count(double)} joints below the head are named '{double}', like a hair chain; rename all but that one"
        )
    parents = np.array([rows.get(int(skeleton.parents[j]), -1) if j not in tops else -1 for j in joints], int)
    chain = np.zeros(len(joints), int)
    for row, parent in enumerate(parents):
        chain[row] = chain[parent] if parent >= 0 else (parents[:row] < 0).sum()
    origins, axes = _origins_and_axes(character, joints)
    return HairChains(
        names=names,
        joints=joints,
        parents=parents,
        chain=chain,
        origins=origins,
        axes=axes,
        bone_joint=bone_joint,
        bone_end=bone_end,
        bones=bones,
    )


def placed_chains(chains: HairChains, character: Character) -> HairChains:
    """A model's chains as they are in the bind pose of a character, found only by the names of their joints: the hair's mesh may be
    hidden, of a lower level of detail, or in another file.

    Args:
        chains: the model's; their `bones` are kept.
        character: whose skeleton has these joints.

    Raises:
        NeuralocksError: a joint is missing, mirrored or unevenly scaled.
    """
    skeleton = character.skeleton
    joints = chains.match(skeleton.names, character.of_head)
    rows = {int(joint): row for row, joint in enumerate(joints)}
    parents = [rows.get(int(skeleton.parents[joint]), -1) for joint in joints]
    origins, axes = _origins_and_axes(character, joints)
    return replace(chains, joints=joints, parents=parents, origins=origins, axes=axes)


def _origins_and_axes(character: Character, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Canonical positions (N, 3) [m] of joints (N,) in the bind pose, and their axes there as columns (N, 3, 3)."""
    bind = character.skeleton.bind[joints]
    _check_scale(character.skeleton, joints)
    axes = character.bind_to_canonical[:3, :3] @ rotation_part(bind, "hair joint in bind pose")
    return character.canonical(bind[:, :3, 3]), axes


def riders(skeleton: Skeleton, joint: int, drives: np.ndarray) -> list[int]:
    """Leaf joints at a joint's own position that drive skin, such as the deform joints of a control rig: they turn with it.

    Args:
        skeleton: bind pose, in which positions are compared [m].
        joint: index in the skeleton.
        drives: which joints drive skin, (J,) bool.
    """
    places = skeleton.bind[:, :3, 3]
    last = [child for child in skeleton.children[joint] if drives[child] and not skeleton.children[child]]
    return [child for child in last if np.linalg.norm(places[child] - places[joint]) < NO_BONE]


def _moving(character: Character, tops: list[int], meshes, places: np.ndarray) -> tuple[dict, dict, dict]:
    """Three dicts of the joints that move: their row among the hair joints; the free end of their bone (3,) [m], if they have one;
    and the joints at the other ends of their bones.
    """
    skeleton = character.skeleton
    drives = driving(skeleton, meshes)
    order = np.flatnonzero(np.any([skeleton.below(top) for top in tops], axis=0)).tolist()
    carries = _carrying(skeleton, order, drives)
    rows, free, ends = {}, {}, {}
    for joint in order:
        riding = riders(skeleton, joint, drives)
        beyond = [child for child in skeleton.children[joint] if child not in riding]
        own, only_markers = [joint, *riding], joint in carries and not carries.intersection(beyond)
        end = None
        if not beyond or only_markers and _astray(character, own, beyond, joint in tops, meshes, places):
            end = _free_end(character, own, joint in tops, meshes, places)
            beyond = beyond if end is None else []
        if beyond and joint in carries or end is not None:
            rows[joint], free[joint], ends[joint] = len(rows), end, beyond
    return rows, free, ends


def driving(skeleton: Skeleton, meshes: list[SkinnedMesh] | None) -> np.ndarray:
    """Which joints (J,) bool drive skin of any mesh."""
    drives = np.zeros(len(skeleton.names), bool)
    for mesh in meshes or ():
        drives |= mesh.driven_by(len(drives))
    return drives


def _bones(skeleton: Skeleton, rows: dict, free: dict, ends: dict, places: np.ndarray) -> tuple[list, list, np.ndarray]:
    """Each bone's joint and the moving one at its end (-1: none), as rows, and its vector (M, 3) [m]."""
    bone_joint, bone_end, bones = [], [], []
    for joint, row in rows.items():
        for end, place in [(rows.get(child, -1), places[child]) for child in ends[joint]] or [(-1, free[joint])]:
            if np.linalg.norm(place - places[joint]) < NO_BONE:
                child = next((leaf(skeleton.names[c]) for c in ends[joint]), "its end")
                raise NeuralocksError(
                    f"skeleton: hair bone '{leaf(skeleton.names[joint])}' has no length ('{child}' lies at the same place); "
                    "move or remove one of the two, or leave the chain out with --chains"
                )
            bone_joint.append(row)
            bone_end.append(end)
            bones.append(place - places[joint])
    return bone_joint, bone_end, np.array(bones)


def _carrying(skeleton: Skeleton, order: list[int], drives: np.ndarray) -> set[int]:
    """Those of these joints that drive skin or have skin further down: end joints may have end joints of their own, which
    exporters add. All of them if none drives any, as in a rig that is not skinned yet.
    """
    carries = set()
    for joint in order:
        up = joint if drives[joint] else -1
        while up >= 0 and up not in carries:
            carries.add(up)
            up = int(skeleton.parents[up])
    return carries if carries else set(order)


def _free_end(character: Character, own: list[int], is_top: bool, meshes, places: np.ndarray) -> np.ndarray | None:
    """Where the bone of a last joint ends (3,) [m]: as far as its skin reaches. None if it drives nothing, that is, if
    it is an end marker.

    Args:
        own: the joint, and those that ride on it.
        is_top: a chain of this joint alone, which points where its skin does; others continue the bone before.
        places: positions of all joints in canonical space, (J, 3) [m].
    """
    joint, parent = own[0], int(character.skeleton.parents[own[0]])
    reach = _reach(character, own, meshes, places)
    if not len(reach):
        return None
    along = reach.mean(axis=0) if is_top else places[joint] - places[parent]
    size = np.linalg.norm(along)
    if size < NO_BONE:
        return None
    along = along / size
    length = float((reach @ along).max())
    # Skin that extends little past the joint belongs to the bone before it: the joint is that bone's end.
    if length < (SHORT if is_top else SHORT_AFTER * size):
        return None
    return places[joint] + length * along


def _astray(character: Character, own: list[int], markers: list[int], is_top: bool, meshes, places: np.ndarray) -> bool:
    """Whether end markers of a joint all lie on the joint itself, or off its skin and off the bone before: exporters put such "leaf
    bones" where a bone's axis points, which need not be along the hair.

    Args:
        own, is_top, places: as for `_free_end`.
        markers: children that drive nothing.
    """
    reach, ends = _reach(character, own, meshes, places), places[markers] - places[own[0]]
    if not len(reach):
        return False
    sizes = np.linalg.norm(ends, axis=1)
    if (sizes < NO_BONE).all():
        return True
    ways = [reach.mean(axis=0)] + ([] if is_top else [places[own[0]] - places[character.skeleton.parents[own[0]]]])
    off = [ends @ way < ASTRAY * sizes * np.linalg.norm(way) for way in ways]
    bare = (reach @ ends.T).max(axis=0) < COVERED * sizes**2
    return bool(np.all([*off, bare]))


def _reach(character: Character, own: list[int], meshes, places: np.ndarray) -> np.ndarray:
    """Skin of the first of these joints and those that ride on it, as seen from there (n, 3) [m]."""
    mask = np.isin(np.arange(len(places)), own)
    points = [mesh.points[mesh.weight_on(mask) > DRIVEN] for mesh in meshes or ()]
    return character.canonical(np.concatenate(points)) - places[own[0]] if points else np.zeros((0, 3))


def _check_scale(skeleton: Skeleton, joints: np.ndarray) -> None:
    for joint in joints:
        linear = skeleton.bind[joint, :3, :3]
        name, scale = leaf(skeleton.names[joint]), np.linalg.norm(linear, axis=0)
        if np.linalg.det(linear) < 0:
            raise NeuralocksError(
                f"hair joint '{name}': mirrored in bind pose (negative scale); apply the scale in the rig"
            )
        if scale.min() < 1e-9 or scale.max() > UNEVEN * scale.min():
            raise UnevenJoint(
                f"hair joint '{name}': unevenly scaled in bind pose {np.round(scale, 3)}; apply the scale in the rig"
            )
