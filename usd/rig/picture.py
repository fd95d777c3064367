# SPDX-License-Identifier: Apache-2.0
"""Rigged mesh hair as a preview draws it: the skinned meshes of its character, hair separate from skin."""

from dataclasses import replace

import numpy as np

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.preview.film import Scene
from neuralocks_core.rig.mesh_parts import parted
from neuralocks_core.rig.rigging import moving_joints
from neuralocks_core.rotation import transformed

from ..shot.characters.whole_body import with_parts
from .stage import RiggedHair, core_meshes


def rigged_scene(rigged: RiggedHair) -> Scene:
    """The character with its hair, posed as the stage has it at the samples of its animation.

    Raises:
        NeuralocksError: the skeleton skins no mesh.
    """
    stage_rig, character = rigged.stage_rig, rigged.stage_rig.character
    if character.body is None:
        raise NeuralocksError(
            f"{stage_rig.path}: it skins no mesh that is shown, so there is nothing to draw; show it, or bind the hair to it"
        )
    body, clip = with_parts(character.body, rigged.elsewhere), stage_rig.clip
    hair = np.zeros(len(body.points), bool)
    own = _hair(rigged)
    hair[: len(own)] = own
    character = replace(character, body=body)
    return Scene(
        times=clip.times,
        head=np.stack([character.carrying(joints) for joints in clip.joints]),
        facing=character.facing,
        centre=transformed(character.head_centre, character.canonical_to_bind),
        counts=np.zeros(0, int),
        rest=body.points[hair],
        hair=lambda frame: np.zeros((0, 3)),
        triangles=body.triangles,
        body=lambda frame: character.posed_body(clip.joints[frame], clip.shape[frame]),
        body_rest=body.points,
        mesh_hair=hair,
        cuts=() if clip.loop else clip.cuts,
        size=character.times_human,
        collar=character.collar,
    )


def _hair(rigged: RiggedHair) -> np.ndarray:
    """Which vertices (V,) of the skeleton's own meshes are hair."""
    meshes, moving = (
        core_meshes(rigged.stage_rig),
        moving_joints(rigged.stage_rig.character.skeleton, rigged.rig.chains),
    )
    result = [np.zeros(0, bool)]
    for mesh, (skin, _) in zip(meshes, parted(rigged.stage_rig.character, meshes, moving)):
        hair = np.ones(len(mesh.points), bool)
        hair[skin] = False
        result.append(hair)
    return np.concatenate(result)
