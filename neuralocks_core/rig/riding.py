# SPDX-License-Identifier: Apache-2.0
"""Which joints of a hair chain turn, and which only ride on those: deform joints, offsets, and what is worn in hair."""

import numpy as np

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.rig.hair_names import says_twist, says_worn
from neuralocks_core.skinned_body import Body

NO_BONE = 1e-5
"""Shorter bones [m] have no direction."""


def in_chains(character: Character, tops: list[int], drives: np.ndarray, named: list[int]) -> np.ndarray:
    """Which joints (J,) bool are in these subtrees and do not ride on them, as deform joints do, and what is worn in hair, which is stiff
    or has an animation of its own, unless hair goes on from it, as from a tie.

    Args:
        character, drives: as for `riders`.
        tops: first joints of the subtrees.
        named: joints that somebody named: what is worn in hair is then hair.
    """
    skeleton = character.skeleton
    inside = skeleton.below(*tops)
    for joint in np.flatnonzero(inside):
        ride = riders(character, joint, drives)
        if joint not in tops and joint not in named and _only_worn(character, joint, drives):
            ride.append(joint)
        if ride:  # few do, and the whole hierarchy is walked for them
            inside[skeleton.below(*ride)] = False
    return inside


def _only_worn(character: Character, joint: int, drives: np.ndarray) -> bool:
    """Whether a joint is worn in hair, with all that drives skin below it."""
    below = [joint, *np.flatnonzero(character.skeleton.below(joint) & drives)]
    return all(says_worn(character.own_names[each]) for each in below)


def riders(character: Character, joint: int, drives: np.ndarray) -> list[int]:
    """Joints that drive skin, with none further down, and lie at a joint's own position, such as the deform joints of a control rig, or
    on its bone, such as twist joints: they turn with it.

    Args:
        character: with the bind pose in which positions are compared [m].
        joint: index in the skeleton.
        drives: which joints drive skin, (J,) bool.
    """
    skeleton, places = character.skeleton, character.skeleton.bind[:, :3, 3]
    skins = {child: int(drives[skeleton.below(child)].sum()) for child in skeleton.children[joint]}
    bones = {child: places[child] - places[joint] for child, count in skins.items() if count}
    found = []
    for child in (child for child in bones if drives[child] and skins[child] == 1):
        if np.linalg.norm(bones[child]) >= NO_BONE:
            rides = says_twist(character.own_names[child]) and any(
                _lies_on(bones[child], bones[other]) for other in bones if other != child
            )
        else:  # beside a joint with skin of its own, one with an end joint is a strand that begins there
            rides = not (drives[joint] and skeleton.children[child])
        found += [child] if rides else []
    return found


def _lies_on(place: np.ndarray, bone: np.ndarray) -> bool:
    """Whether a place (3,) is on a bone (3,)."""
    share = np.clip(place @ bone / max(bone @ bone, NO_BONE**2), 0, 1)
    return bool(np.linalg.norm(place - share * bone) < NO_BONE)


def continued(character: Character, joint: int, drives: np.ndarray) -> int:
    """The joint that a chain goes on with at this one's place: itself, or below offsets, which drive nothing, the one that turns.

    Args:
        character, joint, drives: as for `riders`.
    """
    skeleton, places = character.skeleton, character.skeleton.bind[:, :3, 3]
    while not drives[joint] and not riders(character, joint, drives):
        on = [child for child in skeleton.children[joint] if drives[skeleton.below(child)].any()]
        if len(on) != 1 or np.linalg.norm(places[on[0]] - places[joint]) >= NO_BONE:
            break
        joint = on[0]
    return joint


def driving(skeleton: Skeleton, meshes: list[Body] | None) -> np.ndarray:
    """Which joints (J,) bool drive skin of any mesh."""
    drives = np.zeros(len(skeleton.names), bool)
    for mesh in meshes or ():
        drives |= mesh.driven_by(len(drives))
    return drives
