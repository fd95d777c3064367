# SPDX-License-Identifier: Apache-2.0
"""Whether a character faces backwards, because its left and right joints are the wrong way round."""

import numpy as np

from neuralocks_core.anatomy.humanoid import BY_HAND
from neuralocks_core.anatomy.joint_names import leaf, words
from neuralocks_core.character import Character

from .joints import JointSource

AHEAD = 0.02
"""Eyes are farther ahead of the head joint than this [m], and so far a side is from the other."""
TOES, NO_TOES = ("toe", "ball"), ("heel", "pole", "ik", "target", "ctrl", "roll", "pivot", "twist")
"""Words of joints below a foot that are toes, and that are not."""
FOOT = 0.06
"""Toes are farther from the ankle than this [m], if no name says that they are toes; heels are nearer."""


def backwards_notes(source: JointSource, character: Character) -> list[str]:
    """The note on a bind pose that faces away from where its legs, toes or eyes say: the network's axes follow from its sides."""
    if character.sides is None:
        return []
    witness = _behind(character, source.names)
    if not witness:
        return []
    humanoid = character.humanoid
    given = any(humanoid.reasons.get(name) == BY_HAND for name in humanoid if humanoid[name] in character.sides)
    return [
        f"{source.path}: judged by {_both(character.sides, source.names)}, it faces away from where {witness}, and hair is moved "
        f"as if it did; left and right are swapped, {'check --joint' if given else 'rename them'}"
    ]


def _behind(character: Character, names: list[str]) -> str:
    """What tells that the character faces the other way; nothing if its toes or its eyes are ahead."""
    bind, found = character.skeleton.bind[:, :3, 3] @ character.facing.T, {}
    for side in ("left", "right"):
        foot, eye = (character.humanoid.get(f"{side}_{part}") for part in ("foot", "eye"))
        toes = [] if foot is None else _toes(character, foot, names)
        if toes:
            ways = bind[toes] - bind[foot]
            found.setdefault("its toes point", []).append(ways[np.hypot(ways[:, 0], ways[:, 2]).argmax(), 2])
        if eye is not None:
            found.setdefault("its eyes point", []).append(bind[eye, 2] - bind[character.head, 2])
    if any(max(ahead) > -AHEAD for ahead in found.values()):
        return ""
    legs = [character.humanoid.get(f"{side}_upper_leg") for side in ("left", "right")]
    if not found and None not in legs and bind[legs[0], 0] - bind[legs[1], 0] < -AHEAD:
        return f"{_both(legs, names)} say"
    return next(iter(found), "")


def _toes(character: Character, foot: int, names: list[str]) -> list[int]:
    """Joints below a foot that tell where it points."""
    below, places = character.skeleton.children[foot], character.skeleton.bind[:, :3, 3]
    said = {joint: words(leaf(names[joint])) for joint in below}
    below = [joint for joint in below if not any(word.startswith(NO_TOES) for word in said[joint])]
    named = [joint for joint in below if any(word.startswith(TOES) for word in said[joint])]
    return named or [joint for joint in below if np.linalg.norm((places[joint] - places[foot])[[0, 2]]) > FOOT]


def _both(joints, names: list[str]) -> str:
    return " and ".join(f"'{leaf(names[joint])}'" for joint in joints)
