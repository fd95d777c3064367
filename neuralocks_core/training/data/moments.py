# SPDX-License-Identifier: Apache-2.0
"""Random moments to train on without simulation: three frames with their history, a body in its pose, whole locks.

The paper draws one such moment per step. Here a pool of them is kept, each body with its search tree, because building
the tree would take longer than the step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from neuralocks_core.body.tree_search import surface_tree
from neuralocks_core.materials import MARGIN, NO_PLANE
from neuralocks_core.mesh import vertex_normals
from neuralocks_core.motion import GRAVITY
from neuralocks_core.physics.rods import Rods, rods
from neuralocks_core.physics.self_collision import density
from neuralocks_core.strands.locks import lock_mates, neighbours
from neuralocks_core.training.data.hair_body import posed_over_time
from neuralocks_core.training.data.rollouts import RolloutMaker, TrainingScene

MOMENTS = 6
"""Moments taken from each random clip."""
DEEPEST = 0.04
"""[m] A surface farther than this is not in contact: its plane means nothing at that distance."""


@dataclass(frozen=True, eq=False)
class Moment:
    """One frame that is penalised and the two before it.

    Attributes:
        hair: index of its locks in the pool.
        vectors: boundary vectors (3, F) at t - 2 dt, t - dt and t.
        gravity: (3,) in head axes at t [m/s^2].
        back: (2, 4, 4) transforms from the head's frame at t - dt and t - 2 dt to that at t.
        surface: tree over the body's vertices in canonical space at t, or None.
        normals: (V, 3) of these vertices.
    """

    hair: int
    vectors: np.ndarray
    gravity: np.ndarray
    back: np.ndarray
    surface: cKDTree | None
    normals: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Hair:
    """Strands of whole locks on a body of some shape.

    Attributes:
        groom: index into the scene's grooms.
        strands: (n,) indices into that groom.
        bind: the anchor's boundary vector (F,).
        rods: constants, float32 tensors.
        margin: (n, 24) distance kept from the body, at most the distance at rest [m].
        neighbours: (n, 24, N) int32 for adhesion.
        rest_density: (n, 24) for self-collision; None if unused.
    """

    groom: int
    strands: np.ndarray
    bind: np.ndarray
    rods: Rods
    margin: Tensor
    neighbours: Tensor
    rest_density: Tensor | None


class MomentPool:
    """A growing pool of moments, always the same for the same scene.

    Args:
        scene: what to draw moments from; `scene.strands` strands go with each moment.
        supported: whether the rods carry their own weight at rest.
        nearest_vertices: adhesion to the five nearest vertices, as in the paper, not to the lock's nearest strands.
        volume: whether self-collision is used; its rest density takes longest.
    """

    def __init__(
        self, scene: TrainingScene, *, supported: bool = True, nearest_vertices: bool = False, volume: bool = True
    ):
        self.scene, self.supported, self.nearest_vertices, self.volume = scene, supported, nearest_vertices, volume
        self.hair: list[Hair] = []
        self.moments: list[Moment] = []
        self._maker = RolloutMaker(scene)

    def grow(self) -> None:
        """Add the moments of another random clip."""
        index, maker = len(self.hair), self._maker
        draw = maker.draw(index)
        draw = replace(draw, materials=tuple(replace(material, weight=1.0) for material in draw.materials))
        character, groom = self.scene.character, self.scene.grooms[draw.groom]
        vectors, bind = maker.vectors(draw, self.scene.spec)
        rest = maker.fitted(groom.rest[draw.strands].astype(np.float64), draw.shape)
        self.hair.append(self._hair(draw, groom, rest, bind))
        rng = np.random.default_rng([self.scene.seed, 1, index])
        late = rng.integers(max(draw.first, 2), len(draw.times), size=MOMENTS)
        joints = draw.joints(character)
        head = character.canonical_to_world(joints)
        now = np.linalg.inv(head[late])
        back = np.stack([now @ head[late - 1], now @ head[late - 2]], axis=1)
        bodies = None
        if maker.body is not None:
            skinning = joints[late] @ character.inverse_bind
            world = posed_over_time(maker.body, skinning, draw.shape)
            bodies = np.einsum("tij,tvj->tvi", now[:, :3, :3], world) + now[:, None, :3, 3]
        for i, t in enumerate(late):
            surface = normals = None
            if bodies is not None:
                surface, normals = surface_tree(bodies[i]), vertex_normals(bodies[i], maker.body.triangles)
            gravity = head[t, :3, :3].T @ GRAVITY
            self.moments.append(Moment(index, vectors[t - 2 : t + 1], gravity, back[i], surface, normals))

    def batch(self, rng: np.random.Generator, count: int) -> tuple[list[Moment], list[Hair]]:
        """Random moments and the hair of each."""
        moments = [self.moments[i] for i in rng.integers(len(self.moments), size=count)]
        return moments, [self.hair[moment.hair] for moment in moments]

    def _hair(self, draw, groom, rest: np.ndarray, bind: np.ndarray) -> Hair:
        constants = rods(torch.from_numpy(rest.astype(np.float32)), supported=self.supported)
        margin = np.full(rest.shape[:2], MARGIN, np.float32)
        body = self._maker.body
        if body is not None:
            points = self.scene.character.canonical(body.shaped(draw.shape))
            planes, _ = nearest_planes(surface_tree(points), vertex_normals(points, body.triangles), rest)
            own = (planes[..., :3] * rest).sum(-1) - planes[..., 3]
            margin = np.minimum(margin, own).astype(np.float32)
        if self.nearest_vertices:
            near = neighbours(rest)
        else:
            mates = lock_mates(rest, groom.lock[draw.strands])
            near = np.where(mates >= 0, mates, 0)[:, None, :] * rest.shape[1] + np.arange(rest.shape[1])[:, None]
            near = np.where(mates[:, None, :] >= 0, near, -1)
        return Hair(
            draw.groom,
            draw.strands,
            bind,
            constants,
            torch.from_numpy(margin),
            torch.from_numpy(near.astype(np.int32)),
            density(constants.rest, constants.mass) if self.volume else None,
        )


def nearest_planes(surface: cKDTree, normals: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The body near each point, as the plane of its nearest vertex.

    Args:
        surface: tree over (V, 3) vertices.
        normals: (V, 3), outward.
        points: (..., 3) in the same space.

    Returns:
        planes (..., 4) float32, normal and offset; NO_PLANE where contact is impossible;
        distance (...) float32 to the nearest vertex [m].
    """
    distance, index = surface.query(points)
    normal = normals[index]
    offset = (normal * surface.data[index]).sum(-1)
    height = (normal * points).sum(-1) - offset
    # For a point that is really inside, the nearest vertex lies along its own normal. A plane that only reaches behind a
    # distant point, as the shoulder's does under the chin, does not count.
    contact = (distance < DEEPEST) & ((height > 0) | (-height > 0.5 * distance) | (distance < 0.015))
    planes = np.concatenate([normal, offset[..., None]], axis=-1)
    planes[~contact] = NO_PLANE
    return planes.astype(np.float32), distance.astype(np.float32)
