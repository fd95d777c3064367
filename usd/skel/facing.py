# SPDX-License-Identifier: Apache-2.0
"""Whether a character faces backwards, because its left and right joints are the wrong way round."""

import numpy as np

from neuralocks_core.anatomy.humanoid import BY_HAND
from neuralocks_core.anatomy.joint_names import leaf
from neuralocks_core.character import Character

from .joints import JointSource

AHEAD = 0.02
"""Toes and eyes are farther ahead of ankles and head joint than this [m]."""


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
        if foot is not None and character.skeleton.children[foot]:
            ways = bind[character.skeleton.children[foot]] - bind[foot]
            # A heel's joint is nearer to the ankle than the toes'.
            found.setdefault("its toes point", []).append(ways[np.hypot(ways[:, 0], ways[:, 2]).argmax(), 2])
        if eye is not None:
            found.setdefault("its eyes point", []).append(bind[eye, 2] - bind[character.head, 2])
    if any(max(ahead) > -AHEAD for ahead in found.values()):
        return ""
    legs = [character.humanoid.get(f"{side}_upper_leg") for side in ("left", "right")]
    if not found and None not in legs and bind[legs[0], 0] - bind[legs[1], 0] < -AHEAD:
        return f"{_both(legs, names)} say"
    return next(iter(found), "")


def _both(joints, names: list[str]) -> str:
    return " and ".join(f"'{leaf(names[joint])}'" for joint in joints)
