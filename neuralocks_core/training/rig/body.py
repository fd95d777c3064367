# SPDX-License-Identifier: Apache-2.0
"""The body around the head of a rig with mesh hair: its poses, and distances of points from it."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from neuralocks_core.body.enclosed import proven_distances
from neuralocks_core.body.surface_samples import SurfaceSamples, nearest
from neuralocks_core.character import Character
from neuralocks_core.reference.chain_contact import BodyMesh
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.skinned_body import Body

KEPT = 2000
"""Number of places of each posed body that say which of its faces is nearest."""


class BodyPatch:
    """The part of the body around the head that hair can reach.

    Attributes:
        body: that part, with the blend shapes of bodies, which leave the head unchanged, without those of the face.
        samples: `count` places on it.
        read: the vertices that `samples` read of it, with its blend shapes.
    """

    @classmethod
    @lru_cache(1)
    def of(cls, rig: HairRig, count: int) -> "BodyPatch | None":
        """None if there is no body, or hair reaches none of its faces. A training asks several times for that of its rig."""
        near = _in_reach(rig)
        return None if near is None else cls(near, rig.character, count)

    def __init__(self, near: Body, character: Character, count: int):
        # The hair was fitted to its own head, with the face on it: other bodies vary below it.
        on_head = near.weight_on(character.of_head)
        shapes = {}
        for (name, offsets), of_body in zip(near.shapes.items(), character.body_shapes):
            if not of_body:
                continue
            mean = offsets[on_head > 0.9].mean(axis=0) if (on_head > 0.9).any() else 0.0
            shapes[name] = (offsets - mean) * (1 - on_head)[:, None]
        self.body = replace(near, shapes=shapes)
        self.samples = SurfaceSamples(near.points, near.triangles, count)
        self.read = self.body.part(self.samples.vertices, self.samples.triangles)

    def met(self, rig: HairRig, joints: np.ndarray) -> BodyMesh:
        """What a simulation meets, under world joint transforms (C, T, J, 4, 4)."""
        posed = np.empty((*joints.shape[:2], *self.read.points.shape), np.float32)
        for clip, poses in zip(posed, joints):
            for row, skinning in zip(clip, rig.character.skinning(poses)):
                row[:] = self.read.posed(skinning)
        return BodyMesh(self.samples, posed, rig.character.canonical(self.read.points))


def posed_distances(rig: HairRig, joints: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distances (T, V) [m] of points (T, V, 3), canonical, to the body under world joint transforms (T, J, 4, 4)."""
    body = _in_reach(rig)
    if body is None:
        return np.full(points.shape[:2], np.inf)
    skinning = rig.character.skinning(joints)
    return np.stack([proven_distances(body.posed(m), body.triangles, p) for m, p in zip(skinning, points)])


def _in_reach(rig: HairRig) -> Body | None:
    """The part of the body that hair can reach; None if there is no such part."""
    body = rig.character.body
    near = None if body is None else body.only(body.triangles[rig.in_reach(body)])
    return None if near is None or not len(near.triangles) else near


def rest_clearance(rig: HairRig, points: np.ndarray) -> np.ndarray:
    """Distance (V,) [m] that canonical points (V, 3) may come near the body: their distance in bind pose, exact or as
    `SurfaceSamples` have it, whichever is less.

    In poses, distances are those. Where they are wrong, hair would be thrown from where the artist put it.
    """
    exact, patch = rest_distances(rig, points), BodyPatch.of(rig, KEPT)
    if patch is None or not len(points):
        return exact
    vertices, samples = rig.character.canonical(patch.read.points), patch.samples
    found = nearest(samples.index(vertices), points)
    normals, offsets = samples.planes(found, points, vertices[None])
    return np.minimum(exact, np.einsum("vi,vi->v", points, normals) - offsets)


def rest_distances(rig: HairRig, points: np.ndarray) -> np.ndarray:
    """Signed distances (V,) [m] of canonical points (V, 3) to the body in bind pose; infinite without one."""
    body = rig.character.body
    if body is None:
        return np.full(len(points), np.inf)
    return proven_distances(rig.character.canonical(body.points), body.triangles, points)
