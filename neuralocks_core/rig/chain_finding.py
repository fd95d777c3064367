# SPDX-License-Identifier: Apache-2.0
"""Finding the hair chains of a rig: the joints below the head that drive no body mesh."""

import fnmatch

import numpy as np

from neuralocks_core.anatomy.joint_names import carrier, leaf
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.hair_names import says_face, says_feature, says_hair, says_hair_alone
from neuralocks_core.rig.measuring import measured_chains
from neuralocks_core.rig.riding import continued, driving, riders
from neuralocks_core.skinned_body import Body

UNNAMED = 3
"""A row of this many joints that drive skin below a head may be hair, whatever their names."""
CAP, ASIDE = 0.7, 0.4
"""Share of the skull's width that skin must cover both ways to be a cap, and by which its middle may be off the skull's."""
FAN = 3
"""Least number of chains below one joint: fewer may be one branching chain."""


class NoHairChains(NeuralocksError):
    """No joint is hair, or none has the given names."""


def find_chains(
    character: Character, meshes: list[Body] | None = None, patterns: list[str] | None = None
) -> HairChains:
    """The hair chains of a character.

    Without patterns, a subtree below the head is hair if its joints are named like hair, or if they are not
    named like a face and drive no mesh that a joint outside the head drives too. With patterns (shell
    wildcards, matched against joint paths and their last parts) it is hair if its first joint matches.

    Args:
        character: skeleton and head.
        meshes: the skinned meshes; without them only names decide, and free ends are bones without a joint of their own.
        patterns: names given by the user.

    Raises:
        NoHairChains: there are none.
        NeuralocksError: a bone has no length, or a joint is mirrored or unevenly scaled.
    """
    tops = _by_pattern(character, patterns) if patterns else _by_itself(character, meshes)
    if not tops:
        raise _no_chains(character, meshes)
    return measured_chains(character, sorted(tops), meshes, _matching(character, patterns or []))


def _no_chains(character: Character, meshes: list[Body] | None) -> NoHairChains:
    """The error for a character without a chain, with the likely cause: the hair's joints are elsewhere, drive no skin, or have
    names that do not say hair.
    """
    skeleton, head = character.skeleton, character.head
    names, own, below = skeleton.names, character.own_names, character.of_head
    others = ", ".join(leaf(names[j]) for j in skeleton.children[head][:8]) or "nothing"
    remedy = "name them with --chains PATTERN, or the joint that carries them with --head JOINT"
    # Outside the head, `tail` means a tail.
    elsewhere = [j for j in np.flatnonzero(~below) if says_hair_alone(own[j])]
    drives = driving(skeleton, meshes)
    named = [j for j in np.flatnonzero(below) if j not in character.heads and says_hair(own[j])]
    bare = [j for j in named if not drives[j]]
    caps = [j for j in named if meshes and _is_cap(character, j, meshes)]
    unnamed = left_out(character, meshes or [])
    if elsewhere and skeleton.parents[elsewhere[0]] >= 0:
        first, above = leaf(names[elsewhere[0]]), leaf(names[skeleton.parents[elsewhere[0]]])
        remedy = f"'{first}' hangs from '{above}': name that with --head {above}"
    elif caps:
        remedy = (
            f"'{leaf(names[caps[0]])}' drives all hair on the skull, which goes through it if it turns: give locks joints of their own, "
            f"or name it with --chains {leaf(names[caps[0]])}"
        )
    elif meshes and bare:
        remedy = f"'{leaf(names[bare[0]])}' drives no vertex of a mesh: bind the hair's mesh to it"
    elif unnamed:
        first = leaf(names[unnamed[0]])
        remedy = f"if '{first}' is hair, name all that is to move with --chains, as in --chains {first}"
    return NoHairChains(f"skeleton: no hair chains below '{leaf(names[head])}' (it carries {others}); {remedy}")


def left_out(
    character: Character, meshes: list[Body], chains: HairChains | None = None, least: int = UNNAMED
) -> list[int]:
    """First joints of chains below the head that may be hair but are not moved: their names say nothing, and they are in a mesh
    that the body drives, too, or single joints in one of found chains; or names say what a face has or wears, such as a beard.

    Args:
        character: skeleton and head.
        meshes: the skinned meshes.
        chains: the found ones; None if there are none.
        least: least number of joints in a row that drive skin, except in a mesh of found chains.
    """
    skeleton, found = character.skeleton, []
    drives, body = driving(skeleton, meshes), of_the_body(character, meshes)
    face, feature = (np.array([says(name) for name in character.own_names]) for says in (says_face, says_feature))
    moved = skeleton.below(*([] if chains is None else chains.joints[chains.roots]))
    beside = _beside(skeleton, meshes, moved) & ~body

    def in_a_row(joint: int) -> int:
        return int(drives[joint]) + max(map(in_a_row, skeleton.children[joint]), default=0)

    def may_be_hair(joint: int, worn: bool) -> bool:
        tree = skeleton.below(joint)
        if not drives[joint] or moved[tree].any() or worn and not face[joint]:
            return False
        if face[tree].any():
            return in_a_row(joint) >= UNNAMED and not (feature | body)[tree].any()
        return in_a_row(joint) >= least or beside[joint] and not _is_cap(character, joint, meshes)

    # Below a jaw or a hat, only names tell.
    todo = [(joint, False) for joint in _children(character)]
    while todo:
        joint, worn = todo.pop()
        if may_be_hair(joint, worn):
            found.append(joint)
        elif not moved[joint]:
            todo += [(child, worn or face[joint]) for child in skeleton.children[joint]]
    return sorted(found)


def _beside(skeleton: Skeleton, meshes: list[Body], joints: np.ndarray) -> np.ndarray:
    """Which joints (J,) bool drive a mesh that one of some joints (J,) bool drives."""
    every = [mesh.driven_by(len(skeleton.names)) for mesh in meshes]
    return np.any([np.zeros(len(joints), bool), *(drives for drives in every if drives[joints].any())], axis=0)


def of_the_body(character: Character, meshes: list[Body] | None) -> np.ndarray:
    """Which joints (J,) bool drive a mesh that a joint outside the head drives, too."""
    body, outside = np.zeros(len(character.skeleton.names), bool), ~character.of_head
    for mesh in meshes or ():
        drives = mesh.driven_by(len(body))
        if (drives & outside).any():
            body |= drives
    return body


def fits(name: str, pattern: str) -> bool:
    """Whether a joint's path, or its last part, matches a pattern."""
    return fnmatch.fnmatchcase(name, pattern) or fnmatch.fnmatchcase(leaf(name), pattern)


def _matching(character: Character, patterns: list[str]) -> list[int]:
    return [j for j, name in enumerate(character.skeleton.names) if any(fits(name, each) for each in patterns)]


def _by_pattern(character: Character, patterns: list[str]) -> list[int]:
    """First joints of the subtrees whose first joint matches."""
    names, parents = character.skeleton.names, character.skeleton.parents
    hits = _matching(character, patterns)
    if not hits:
        raise NoHairChains(
            f"--chains {' '.join(patterns)}: no joint has such a name; see neuralocks inspect for their names"
        )
    inside = [joint for joint in hits if character.of_head[joint] and joint not in character.heads]
    if hits == [character.head]:
        raise NeuralocksError(
            f"--chains {' '.join(patterns)}: joint '{leaf(names[character.head])}' is the head; name the first joints of the hair, "
            "which hang below it"
        )
    over = [joint for joint in hits if character.skeleton.below(joint)[character.head]]
    if not inside and over:
        raise NeuralocksError(
            f"--chains {' '.join(patterns)}: joint '{leaf(names[over[0]])}' carries the head; name the first joints of the hair, which "
            f"hang below '{leaf(names[character.head])}'"
        )
    if not inside:
        above, head = carrier(names[character.head], *(names[joint] for joint in hits)), leaf(names[character.head])
        raise NeuralocksError(
            f"skeleton: joint '{leaf(names[hits[0]])}' does not hang below the head joint '{head}', but from '{above}': name that "
            f"with --head {above}, as in training, or name other joints"
        )
    below = character.skeleton.below(*inside)  # joints of a tail or a coat may have the same names, too
    return [joint for joint in inside if not below[parents[joint]]]


def _children(character: Character) -> list[int]:
    """The joints that hang from the head, or from copies of it, which are none of its children."""
    every = (child for head in character.heads for child in character.skeleton.children[head])
    return [child for child in every if child not in character.heads]


def _by_itself(character: Character, meshes: list[Body] | None) -> list[int]:
    """First joints of the subtrees that are hair by their names or by what they drive."""
    skeleton = character.skeleton
    names, children = character.own_names, skeleton.children
    used, body = driving(skeleton, meshes), of_the_body(character, meshes)
    least = 2 if _has_leaf_bones(character, used) else 1
    tops, short, todo = [], [], [(joint, False) for joint in _children(character)]
    while todo:
        joint, worn = todo.pop()
        tree = np.flatnonzero(skeleton.below(joint))
        steered = _steered(character, joint, used, meshes)
        hair = any(says_hair(names[j]) for j in [joint, *steered])
        if meshes and not used[tree].any():
            continue
        # Below a jaw or a hat, only a name identifies hair.
        worn = worn or says_face(names[joint]) and not hair
        below = [(child, worn) for child in children[joint]]
        # A holder that drives nothing is not a hair bone: its children are. Without meshes, only a fan reveals a holder.
        if (not used[joint] and not steered) if meshes else len(below) > 1:
            todo += below
            continue
        strange = meshes and len(tree) > 1 and not body[tree].any() and not any(says_face(names[j]) for j in tree)
        holds = bool(meshes) and (_is_cap(character, joint, meshes) or _only_shares(skeleton, joint, used, meshes))
        if not hair and (worn or not strange) or holds:
            todo += below
        elif hair or len(tree) > least:
            tops.append(joint)
        else:
            short.append(joint)
    # An end joint that every bone has tells nothing, but hair's own mesh does.
    beside = _beside(skeleton, meshes or [], skeleton.below(*tops))
    return tops + [joint for joint in short if beside[skeleton.below(joint)].any()]


def _has_leaf_bones(character: Character, used: np.ndarray) -> bool:
    """Whether an exporter gave each last joint an end joint, also those of hands and feet: then a rigid part has one, too."""
    children, body = character.skeleton.children, np.flatnonzero(used & ~character.of_head)
    ends = [joint for joint in body if not any(used[child] or children[child] for child in children[joint])]
    return bool(ends) and all(children[joint] for joint in ends)


def _steered(character: Character, joint: int, used: np.ndarray, meshes: list[Body] | None) -> list[int]:
    """Riders of a joint that drives nothing itself but is a hair bone, as in a chain of controls: one other joint that has riders
    too continues from it. Taken for a holder, it would leave each bone to turn about a pivot of its own.
    """
    skeleton = character.skeleton
    riding = riders(character, joint, used)
    on = [child for child in skeleton.children[joint] if child not in riding and used[skeleton.below(child)].any()]
    if used[joint] or len(on) != 1 or used[on[0]] or not riders(character, continued(character, on[0], used), used):
        return []
    return [] if any(_is_cap(character, rider, meshes) for rider in riding) else riding


def _only_shares(skeleton: Skeleton, joint: int, used: np.ndarray, meshes: list[Body]) -> bool:
    """Whether chains fan out from a joint that has a part of their roots by smoothed weights, but no skin of its own."""
    fan = [child for child in skeleton.children[joint] if used[skeleton.below(child)].any()]
    only = np.arange(len(skeleton.names)) == joint
    return len(fan) >= FAN and not any((mesh.weight_on(only) > 0.55).any() for mesh in meshes)


def _is_cap(character: Character, joint: int, meshes: list[Body]) -> bool:
    """Whether a joint drives the hair on the skull: skin around its middle, nearly as wide and as deep as it is wide. If it turned,
    it would slide over the skull and go through it; the joints below it move.
    """
    points, skull = _driven(character, joint, meshes), _skull(character, meshes)
    if min(len(points), len(skull)) < 8:
        return False
    low, high = skull.min(axis=0), skull.max(axis=0)
    width = (high - low).min()  # without ears, or without a nose
    off = np.abs((points.min(axis=0) + points.max(axis=0) - low - high) / 2)
    return bool((np.ptp(points, axis=0) > CAP * width).all() and (off < ASIDE * width).all())


def _skull(character: Character, meshes: list[Body]) -> np.ndarray:
    """Where the upper half of the head's own skin is, seen from above (n, 2) [m]: without hats, bows and hair on joints of its own."""
    if character.body is None:
        return _driven(character, character.head, meshes)
    points = character.canonical(character.body.points[character.on_head_joint & character.skin])
    return points[points[:, 1] > points[:, 1].max(initial=0.0) / 2][:, [0, 2]]


def _driven(character: Character, joint: int, meshes: list[Body]) -> np.ndarray:
    """Where the vertices that mainly follow a joint are, seen from above (n, 2) [m]."""
    only = np.arange(len(character.skeleton.names)) == joint
    points = np.concatenate([mesh.points[mesh.weight_on(only) > 0.5] for mesh in meshes])
    return character.canonical(points)[:, [0, 2]]
