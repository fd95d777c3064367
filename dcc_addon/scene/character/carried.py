# SPDX-License-Identifier: GPL-3.0-or-later
"""What an armature carries: its hair, and the body that the hair is kept out of."""

from ..objects.lookup import in_scene
from . import body as body_reader


def hairs_of(armature, scene) -> list:
    """Hair objects of the scene that this armature carries."""
    return [o for o in scene.objects if o.type == "CURVES" and o.neuralocks_hair.armature == armature]


def bodies_of(armature, scene) -> list:
    """The body mesh chosen by the artist, otherwise all meshes that the armature deforms and that are rendered."""
    chosen = armature.neuralocks_character.body
    if chosen is not None and chosen.type == "MESH" and in_scene(chosen, scene):
        return [chosen]
    return body_reader.find(armature, scene)
