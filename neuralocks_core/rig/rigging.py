# SPDX-License-Identifier: Apache-2.0
"""A rig's hair split from its body: what moves, what it is skinned to, and what it must stay out of."""

from dataclasses import dataclass, replace

import numpy as np

from neuralocks_core.body.holes import closed_holes
from neuralocks_core.character import Character, Skeleton
from neuralocks_core.rig.chain_finding import find_chains
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.kinematics import skin_weights
from neuralocks_core.rig.mesh_parts import parted
from neuralocks_core.skinned_body import Body

ROOM = 0.2
"""Hair may touch a body this far beyond where it rests [m], since the neck bends."""


@dataclass(frozen=True, eq=False)
class HairRig:
    """What training, report and pictures need from a rig.

    Attributes:
        character: its body holds no hair, and holes of its head are closed; it has none if nothing is in the hair's reach, as
            with only shoes.
        chains: the hair joints.
        points: vertices that the hair joints move, canonical bind pose, (V, 3) [m].
        weights: on the head and on each hair joint, (V, 1 + N).
    """

    character: Character
    chains: HairChains
    points: np.ndarray
    weights: np.ndarray

    def with_body(self, body: Body | None) -> "HairRig":
        """The same hair with another body, the holes of whose head are closed, or with none if that is out of its reach."""
        who = self.character
        if body is None or not self.in_reach(body).any():
            return replace(self, character=replace(who, body=None))
        lids = closed_holes(who.canonical(body.points), body.triangles, replace(who, body=body).on_head)
        body = replace(body, triangles=np.concatenate([body.triangles, lids]))
        return replace(self, character=replace(who, body=body))

    def in_reach(self, body: Body) -> np.ndarray:
        """Which triangles (F,) bool of the character's body the hair could touch."""
        chains = self.chains
        hair = np.concatenate([self.points, chains.origins, chains.origins[chains.bone_joint] + chains.bones])
        away = np.linalg.norm(self.character.canonical(body.points), axis=1)
        return (away < np.linalg.norm(hair, axis=1).max() + ROOM)[body.triangles].all(axis=1)


def assemble_rig(character: Character, meshes: list[Body], chains: HairChains | list[str] | None = None) -> HairRig:
    """Split a character's meshes, which `character.body` holds one after another, by its hair chains: the given ones, those that
    match patterns, or those that `find_chains` finds by itself.
    """
    if not isinstance(chains, HairChains):
        chains = find_chains(character, meshes, chains)
    skeleton = character.skeleton
    count = len(skeleton.names)
    moving = moving_joints(skeleton, chains)
    body_triangles, points, weights, start = [], [], [], 0
    for mesh, (body, moved) in zip(meshes, parted(character, meshes, moving)):
        body_triangles.append(body + start)
        start += len(mesh.points)
        if not moved.any():
            continue
        points.append(character.canonical(mesh.points[moved]))
        weights.append(
            skin_weights(chains, count, skeleton.parents, mesh.joint_indices[moved], mesh.joint_weights[moved])
        )
    body = character.body
    if body is not None:
        faces = np.concatenate(body_triangles) if body_triangles else np.zeros((0, 3), int)
        body = replace(body, triangles=faces) if len(faces) else None
    rig = HairRig(
        character,
        chains,
        np.concatenate(points) if points else np.zeros((0, 3)),
        np.concatenate(weights) if weights else np.zeros((0, len(chains) + 1)),
    )
    return rig.with_body(body)


def moving_joints(skeleton: Skeleton, chains: HairChains) -> np.ndarray:
    """Which joints (J,) are hair or below hair."""
    return skeleton.below(*chains.joints[chains.roots])
