# SPDX-License-Identifier: Apache-2.0
"""A rig's hair and body apart: what moves, what it is skinned to, and what it must stay out of."""

from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.character import Body, Character
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.finding import SkinnedMesh, find_chains, split_meshes
from neuralocks_core.rig.kinematics import skin_weights


@dataclass(frozen=True)
class HairRig:
    """What training, report and pictures need of a rig.

    Attributes:
        character: its body holds no hair.
        chains: the hair joints.
        points: vertices that the hair joints move, canonical bind pose, (V, 3) [m].
        weights: on the head and on each hair joint, (V, 1 + N).
        triangles: of the hair, (F, 3) int into `points`.
    """

    character: Character
    chains: HairChains
    points: np.ndarray
    weights: np.ndarray
    triangles: np.ndarray


def assemble_rig(character: Character, meshes: list[SkinnedMesh], patterns: list[str] | None = None) -> HairRig:
    """Find the chains of a character and part its meshes; `character.body` holds the meshes one after another."""
    chains = find_chains(character, meshes, patterns)
    skeleton = character.skeleton
    count = len(skeleton.names)
    moving = np.zeros(count, bool)
    moving[chains.joints] = True
    for joint in range(count):
        moving[joint] |= skeleton.parents[joint] >= 0 and moving[skeleton.parents[joint]]
    body_triangles, points, weights, triangles = [], [], [], []
    start, taken = 0, 0
    for mesh, (body, moved) in zip(meshes, split_meshes(meshes, skeleton.parents, character.head, moving)):
        body_triangles.append(body + start)
        start += len(mesh.points)
        if not moved.any():
            continue
        points.append(character.canonical(mesh.points[moved]))
        weights.append(
            skin_weights(chains, count, skeleton.parents, mesh.joint_indices[moved], mesh.joint_weights[moved])
        )
        place = np.cumsum(moved) - 1 + taken
        triangles.append(place[mesh.triangles[moved[mesh.triangles].all(axis=1)]])
        taken += int(moved.sum())
    body = character.body
    if body is not None:
        faces = np.concatenate(body_triangles) if body_triangles else np.zeros((0, 3), int)
        body = Body(body.points, faces, body.joint_indices, body.joint_weights, body.shapes) if len(faces) else None
    return HairRig(
        replace(character, body=body),
        chains,
        np.concatenate(points) if points else np.zeros((0, 3)),
        np.concatenate(weights) if weights else np.zeros((0, len(chains) + 1)),
        np.concatenate(triangles) if triangles else np.zeros((0, 3), int),
    )
