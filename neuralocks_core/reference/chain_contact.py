# SPDX-License-Identifier: Apache-2.0
"""Which points of mesh hair on joint chains collide with the body in a simulation, and where the body is."""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.body.surface_samples import SurfaceSamples, nearest
from neuralocks_core.rig.chains import HairChains

CORNERS, MORE, APART = 8, 32, 0.02
"""Points of each joint's mesh that collide with the body: the corners, and up to MORE where one is farther than APART [m] from all
others, as on large locks. With only spheres at the ends and middles of the bones, the mesh was up to 24 mm deep in the body."""
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
    """The bodies of one step, vertices (C, V, 3) of a mesh with such samples."""

    def __init__(self, samples: SurfaceSamples, vertices: np.ndarray):
        self.samples, self.vertices = samples, vertices
        self._index = [samples.index(body) for body in vertices]

    def planes(self, where):
        """Plane n.x = d through the place of the body nearest to each of `where` (C, Q, 3), across the way there: normals n
        (C, Q, 3) and offsets d (C, Q).
        """
        found = np.concatenate([nearest(index, points) for index, points in zip(self._index, where)])
        clip = np.repeat(np.arange(len(where)), where.shape[1])
        normals, offsets = self.samples.planes(found, where.reshape(-1, 3), self.vertices, clip)
        return normals.reshape(where.shape), offsets.reshape(where.shape[:2])


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
