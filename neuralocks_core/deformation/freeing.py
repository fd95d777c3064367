# SPDX-License-Identifier: Apache-2.0
"""Hair that was made for another head, taken out of the body on which it is put."""

from dataclasses import replace

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.deformation.carrier import Carrier
from neuralocks_core.deformation.resolve import Resolver
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.strands.strand_set import strands_on


def freed(groom: Groom, character: Character) -> tuple[Groom, np.ndarray]:
    """The groom with strands that rest in the body laid over it, every edge's length kept, and how far each was moved (S,) [m].

    A bake cannot do this: it must leave hair that rests in the body where its author has put it. Hats and glasses are no obstacle: hair
    that goes in under their rims would be crumpled between them and the skin.

    Args:
        groom: in bind-world metres, its roots on the skin.
        character: whose body it is.
    """
    strands = strands_on(character, groom)
    character = _bareheaded(character)
    unshaped = np.zeros((1, len(character.body.shapes) if character.body else 0))
    displacement = Resolver(character, strands, Clip([0.0], character.skeleton.bind[None], unshaped)).freed()
    points = Carrier(groom, strands).carry(displacement)
    return replace(groom, points=points), np.linalg.norm(displacement, axis=2).max(axis=1, initial=0.0)


def _bareheaded(character: Character) -> Character:
    """The character without what its head wears, and without hair of its own."""
    body = character.body
    if body is None:
        return character
    kept = ~(character.on_head & ~character.skin)[body.triangles].any(axis=1)
    return character if kept.all() else replace(character, body=body.only(body.triangles[kept]))
