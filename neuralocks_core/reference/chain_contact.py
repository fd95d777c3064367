# SPDX-License-Identifier: Apache-2.0
"""Which points of mesh hair on joint chains collide with the body in a simulation, and where the body is."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from neuralocks_core.rig.chains import HairChains

CORNERS = 8
"""Points of each joint's mesh that collide with the body. With only spheres at the ends and middles of the bones, the mesh was up
to 24 mm deep in the body; with these points, up to 4 mm."""
BONE_RADIUS = 0.012
"""[m] kept from the body by the bones of hair without a mesh."""


@dataclass(frozen=True)
class BodyPoints:
    """A thousand body vertices around the head of each clip and step, in the head's frame.

    Attributes:
        points, normals: (C, T, P, 3) float32 [m].
        rest_points, rest_normals: of the bind pose, (P, 3).
    """

    points: np.ndarray
    normals: np.ndarray
    rest_points: np.ndarray
    rest_normals: np.ndarray


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
            corners = _far_apart(mine, CORNERS)
            joints += [joint] * len(corners)
            chosen += corners
        return cls(np.array(joints), np.array(chosen), np.full(len(joints), radius))


class NearestVertices:
    """The bodies of one step, points and normals (C, P, 3), for nearest-vertex queries."""

    def __init__(self, points, normals):
        self.points, self.normals = points, normals
        self._trees = [cKDTree(p, balanced_tree=False, compact_nodes=False) for p in points]

    def planes(self, where):
        """Plane n.x = d of the body vertex nearest to each of `where` (C, Q, 3): normals n (C, Q, 3) and offsets d (C, Q)."""
        nearest = np.stack([tree.query(points)[1] for tree, points in zip(self._trees, where)])
        rows = np.arange(len(where))[:, None]
        normals = self.normals[rows, nearest].astype(float)
        return normals, np.einsum("cqi,cqi->cq", normals, self.points[rows, nearest])


def _far_apart(points: np.ndarray, count: int) -> list[np.ndarray]:
    """At most `count` of points (V, 3): each is the farthest from those before it, the first from their mean."""
    chosen = []
    distance = np.linalg.norm(points - points.mean(axis=0), axis=1)
    for _ in range(min(count, len(points))):
        chosen.append(points[distance.argmax()])
        distance = np.minimum(distance, np.linalg.norm(points - chosen[-1], axis=1))
    return chosen
