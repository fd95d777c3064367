# SPDX-License-Identifier: Apache-2.0
"""Which points of mesh hair on joint chains collide with the body in a simulation, and where the body is."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.body.surface_samples import NEAR, SurfaceSamples, nearest
from neuralocks_core.materials import NO_PLANE
from neuralocks_core.rig.chains import HairChains

CORNERS, MORE, APART = 8, 32, 0.02
"""Points of each joint's mesh that collide with the body: the corners, and up to MORE where one is farther than APART [m] from all
others, as on large locks. With only spheres at the ends and middles of the bones, the mesh was up to 24 mm deep in the body."""
ROOM, ROUGH = 0.01, 0.02
"""[m] How much farther than its bones fly a contact is taken to move in a step; only edges of limp, broad ribbons move more. How exactly
distances beyond NEAR are known, where only one face is looked at."""
BONE_RADIUS = 0.012
"""[m] kept from the body by the bones of hair without a mesh."""


@dataclass(frozen=True)
class BodyMesh:
    """The body around the head of each clip and step, in the head's frame.

    Attributes:
        samples: places on its faces.
        vertices: (C, T, V, 3) float32 [m].
        rest: vertices of the bind pose, (V, 3).
    """

    samples: SurfaceSamples
    vertices: np.ndarray
    rest: np.ndarray


@dataclass(frozen=True)
class Contacts:
    """Points of the hair that collide with the body.

    Attributes:
        joint: which joint each is fixed to, (Q,).
        points: canonical bind pose, (Q, 3) [m].
        radius: distance kept from the body, (Q,) [m]; less where a point is nearer at rest.
    """

    joint: np.ndarray
    points: np.ndarray
    radius: np.ndarray

    @classmethod
    def of_bones(cls, chains: HairChains) -> "Contacts":
        """Ends and middles of the bones, for hair without a mesh."""
        start = chains.origins[chains.bone_joint]
        points = np.concatenate([start + chains.bones, start + chains.bones / 2])
        return cls(np.tile(chains.bone_joint, 2), points, np.full(len(points), BONE_RADIUS))

    @classmethod
    def of_mesh(cls, chains: HairChains, points: np.ndarray, weights: np.ndarray, radius: float) -> "Contacts":
        """A few vertices of each joint's share of a mesh, as far apart as they can be.

        Args:
            chains: the hair joints.
            points: the mesh's vertices, canonical bind pose, (V, 3) [m].
            weights: on the head and each joint, (V, 1 + N); a vertex counts for the joint that drives more than half of it.
            radius: distance kept from the body [m].
        """
        joints, chosen = [], []
        for joint in range(len(chains)):
            mine = points[weights[:, 1 + joint] > 0.5]
            if not len(mine):
                mine = chains.origins[joint] + chains.bones[chains.bone_joint == joint]
            corners = _far_apart(mine)
            joints += [joint] * len(corners)
            chosen += corners
        return cls(np.array(joints), np.array(chosen), np.full(len(joints), radius))


class NearestFaces:
    """The planes of bodies in motion, one of each clip, near contacts that move, too.

    Finding them is half of a simulation's time, and few contacts are near. A contact whose distance was known cannot have come
    nearer than by what it and the body have moved since.

    Args:
        samples: places on the faces of all of the bodies.
    """

    def __init__(self, samples: SurfaceSamples):
        self.samples, self._bodies, self._index = samples, None, []
        self._clear, self._places = None, None

    def move(self, bodies: np.ndarray) -> None:
        """The bodies' vertices (C, V, 3) [m] of the next step."""
        if self._clear is not None:
            self._clear -= np.sqrt(np.square(bodies - self._bodies).sum(axis=2).max(axis=1))[:, None]
        self._bodies, self._index = bodies, [None] * len(bodies)

    def planes(self, where: np.ndarray, reach=np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Plane n.x = d through the place of the body nearest to each of `where` (C, Q, 3), across the way there: normals n
        (C, Q, 3) and offsets d (C, Q). Of contacts that cannot be nearer than `reach` (C, Q) [m] and ROOM, it is one that
        everything is outside of.
        """
        if self._clear is None:
            self._clear = np.full(where.shape[:2], -np.inf)
        else:
            self._clear -= np.linalg.norm(where - self._places, axis=2)
        self._places = where
        normals, offsets = np.zeros(where.shape), np.full(where.shape[:2], NO_PLANE[3])
        clip, contact = np.nonzero(self._clear < reach + ROOM)
        if not len(clip):
            return normals, offsets
        found = [self._nearest(row, where[row, contact[clip == row]]) for row in np.unique(clip)]
        near = self.samples.planes(np.concatenate(found), where[clip, contact], self._bodies, clip)
        normals[clip, contact], offsets[clip, contact] = near
        distance = np.einsum("ni,ni->n", near[0], where[clip, contact]) - near[1]
        known = np.where(distance < NEAR, distance, np.maximum(NEAR, distance - ROUGH))
        self._clear[clip, contact] = np.where(near[1] == NO_PLANE[3], -np.inf, known)
        return normals, offsets

    def _nearest(self, clip: int, points: np.ndarray) -> np.ndarray:
        if self._index[clip] is None:
            self._index[clip] = self.samples.index(self._bodies[clip])
        return nearest(self._index[clip], points)


def _far_apart(points: np.ndarray) -> list[np.ndarray]:
    """Some of points (V, 3): each is the farthest from those before it, the first from their mean."""
    chosen = []
    distance = np.linalg.norm(points - points.mean(axis=0), axis=1)
    for place in range(min(CORNERS + MORE, len(points))):
        if place >= CORNERS and distance.max() < APART:
            break
        chosen.append(points[distance.argmax()])
        distance = np.minimum(distance, np.linalg.norm(points - chosen[-1], axis=1))
    return chosen
