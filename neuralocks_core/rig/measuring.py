# SPDX-License-Identifier: Apache-2.0
"""Measuring hair joints: which of them move, where their bones end, and how they lie in the bind pose."""

from dataclasses import replace

import numpy as np

from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.hair_names import says_end
from neuralocks_core.rig.riding import NO_BONE, continued, driving, in_chains, riders
from neuralocks_core.rotation import rotation_part
from neuralocks_core.skinned_body import Body

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


def measured_chains(character: Character, tops: list[int], meshes: list[Body] | None, named: list[int]) -> HairChains:
    """The chains that begin at these joints.

    Args:
        character: whose skeleton they are in.
        tops: first joints of the subtrees, ascending.
        meshes: the skinned meshes, which tell where free ends are.
        named: joints that somebody named; see `in_chains`.

    Raises:
        NeuralocksError: no joint moves, a bone has no length, two hair joints share a name, a chain's first joint has the
            name of another joint below the head, or a joint is mirrored or unevenly scaled.
    """
    skeleton = character.skeleton
    places = character.canonical(skeleton.bind[:, :3, 3])
    rows, free, ends = _moving(character, tops, meshes, named, places)
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
    parents = _parents(skeleton, rows)
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
    origins, axes = _origins_and_axes(character, joints)
    return replace(chains, joints=joints, parents=_parents(skeleton, rows), origins=origins, axes=axes)


def _parents(skeleton: Skeleton, rows: dict[int, int]) -> np.ndarray:
    """Row of the moving joint that carries each one (N,), -1 if none does; between the two may be joints that do not move."""
    found = []
    for joint in rows:
        up = int(skeleton.parents[joint])
        while up >= 0 and up not in rows:
            up = int(skeleton.parents[up])
        found.append(rows.get(up, -1))
    return np.array(found, int)


def _origins_and_axes(character: Character, joints: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Canonical positions (N, 3) [m] of joints (N,) in the bind pose, and their axes there as columns (N, 3, 3)."""
    bind = character.skeleton.bind[joints]
    _check_scale(character.skeleton, joints)
    axes = character.bind_to_canonical[:3, :3] @ rotation_part(bind, "hair joint in bind pose")
    return character.canonical(bind[:, :3, 3]), axes


def _moving(
    character: Character, tops: list[int], meshes, named: list[int], places: np.ndarray
) -> tuple[dict, dict, dict]:
    """Three dicts of the joints that move: their row among the hair joints; the free end of their bone (3,) [m], if they have one;
    and the joints at the other ends of their bones.
    """
    skeleton = character.skeleton
    drives = driving(skeleton, meshes)
    inside = in_chains(character, tops, drives, named)
    order = np.flatnonzero(inside).tolist()
    carries = _carrying(skeleton, order, drives)
    rows, free, ends = {}, {}, {}
    for joint in order:
        if continued(character, joint, drives) != joint:
            continue
        riding = riders(character, joint, drives)
        beyond = [child for child in skeleton.children[joint] if inside[child]]
        # What has no skin beside what has some is a socket or a pole, and not where the bone ends.
        beyond = [child for child in beyond if child in carries] or beyond
        if len(beyond) > 1 and not carries.intersection(beyond):
            beyond = _ahead(character, joint, beyond, places)
        own, only_markers = [joint, *riding], joint in carries and not carries.intersection(beyond)
        end = None
        if not beyond or only_markers and _astray(character, own, beyond, joint in tops, meshes, places):
            end = _free_end(character, own, joint in tops, meshes, places)
            beyond = beyond if end is None else []
        if beyond and joint in carries or end is not None:
            rows[joint], free[joint] = len(rows), end
            ends[joint] = [continued(character, child, drives) for child in beyond]
    return rows, free, ends


def _bones(skeleton: Skeleton, rows: dict, free: dict, ends: dict, places: np.ndarray) -> tuple[list, list, np.ndarray]:
    """Each bone's joint and the moving one at its end (-1: none), as rows, and its vector (M, 3) [m]."""
    bone_joint, bone_end, bones = [], [], []
    for joint, row in rows.items():
        for child in ends[joint] or [None]:
            end, place = (-1, free[joint]) if child is None else (rows.get(child, -1), places[child])
            if np.linalg.norm(place - places[joint]) < NO_BONE:
                there = "its end" if child is None else leaf(skeleton.names[child])
                raise NeuralocksError(
                    f"skeleton: hair bone '{leaf(skeleton.names[joint])}' has no length ('{there}' lies at the same place); "
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
    joint = own[0]
    reach = _reach(character, own, meshes, places)
    if not len(reach):
        return None
    along = reach.mean(axis=0) if is_top else _before(character.skeleton, joint, places)
    size = np.linalg.norm(along)
    if size < NO_BONE:
        return None
    along = along / size
    length = float((reach @ along).max())
    # Skin that extends little past the joint belongs to the bone before it: the joint is that bone's end.
    if length < (SHORT if is_top else SHORT_AFTER * size):
        return None
    return places[joint] + length * along


def _before(skeleton: Skeleton, joint: int, places: np.ndarray) -> np.ndarray:
    """From the start of the bone before a joint to the joint (3,) [m]."""
    up = int(skeleton.parents[joint])
    while np.linalg.norm(places[joint] - places[up]) < NO_BONE and skeleton.parents[up] >= 0:
        up = int(skeleton.parents[up])
    return places[joint] - places[up]


def _ahead(character: Character, joint: int, markers: list[int], places: np.ndarray) -> list[int]:
    """The one of several joints without skin that is called an end, or lies most in the direction of the bone before: others are
    sockets.
    """
    markers = [marker for marker in markers if says_end(character.own_names[marker])] or markers
    before = _before(character.skeleton, joint, places)
    ways = places[markers] - places[joint]
    along = ways @ before / np.maximum(np.linalg.norm(ways, axis=1) * np.linalg.norm(before), NO_BONE**2)
    return [markers[int(np.argmax(np.where(np.linalg.norm(ways, axis=1) < NO_BONE, -2, along)))]]


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
    ways = [reach.mean(axis=0)] + ([] if is_top else [_before(character.skeleton, own[0], places)])
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
