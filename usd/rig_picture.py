# SPDX-License-Identifier: Apache-2.0
"""Rigged mesh hair as a preview draws it: the skinned meshes of its character, hair told from skin."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from neuralocks_core.character import Body
from neuralocks_core.preview import Scene

from .border import transformed
from .rig_stage import RiggedHair

MOVED = 0.3
"""Share of its vertices that hair joints move from which all of a mesh, or of a connected piece of one, counts as hair:
roots, and the cap that they stand on, ride on the head."""


def rigged_scene(rigged: RiggedHair) -> Scene:
    """The character with its hair, posed as the stage has it at the samples of its animation."""
    source = rigged.source
    character, clip, body = source.character, source.clip, source.character.body
    skeleton, moving = character.skeleton, np.zeros(len(character.skeleton.names), bool)
    moving[rigged.rig.chains.joints] = True
    for joint, parent in enumerate(skeleton.parents):
        moving[joint] |= parent >= 0 and moving[parent]
    hair = (body.joint_weights * moving[body.joint_indices]).sum(axis=1) > 0.5
    hair = _whole(_pieces(body), hair)
    hair = _whole(np.repeat(np.arange(len(source.meshes)), [len(mesh.points) for mesh in source.meshes]), hair)
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
    )


def _pieces(body: Body) -> np.ndarray:
    """Number of the connected piece of mesh that each vertex is in (V,)."""
    first, second = body.triangles.T.ravel(), body.triangles[:, [1, 2, 0]].T.ravel()
    count = len(body.points)
    links = coo_array((np.ones(len(first), bool), (first, second)), (count, count))
    return connected_components(links, directed=False)[1]


def _whole(part: np.ndarray, hair: np.ndarray) -> np.ndarray:
    """Vertices that are hair (V,), and all of the parts (V,) that are mostly hair."""
    return hair | (np.bincount(part, hair) / np.maximum(np.bincount(part), 1) > MOVED)[part]
