# SPDX-License-Identifier: Apache-2.0
"""Push hair out of the body after the network, with every segment's length kept."""

import numpy as np

from neuralocks_core.character import Body, Character
from neuralocks_core.collider import Collider
from neuralocks_core.strands import StrandSet

MARGIN = 0.001
"""Clearance that a pushed vertex gets [m]."""
ITERATIONS = 6
CLAMPED = 2
"""Vertices at the root that never move."""
BAND = 0.01
"""A strand that enters the body passes within this of its surface with some vertex [m]: half of the longest segment
that hair of half a metre has."""


class Resolver:
    """Keeps one groom out of its character's body, frame by frame, in canonical space.

    Args:
        character: whose body the hair must stay out of; without a body nothing is done.
        strands: the groom at rest.
        shape: blend shape weights (B,) of the pose in which the groom rests.
    """

    def __init__(self, character: Character, strands: StrandSet, shape: np.ndarray | None = None):
        self.character, self.strands = character, strands
        self._body = None if character.body is None else _within_reach(character, strands)
        if self._body is not None:
            to_canonical = np.linalg.inv(character.canonical_to_bind)
            points = self._body.shaped(shape) @ to_canonical[:3, :3].T + to_canonical[:3, 3]
            self.rest_distance = Collider(points, self._body.triangles).distance(strands.rest)[0]

    def collider(self, joints: np.ndarray, shape: np.ndarray | None = None) -> Collider | None:
        """The body that the hair can reach, posed by world joint transforms (J, 4, 4), in canonical space."""
        if self._body is None:
            return None
        to_canonical = np.linalg.inv(self.character.canonical_to_world(joints))
        skinning = to_canonical @ np.asarray(joints, float) @ self.character.inverse_bind
        return Collider(self._body.posed(skinning, shape), self._body.triangles)

    def displacement(self, displacement: np.ndarray, joints: np.ndarray, shape: np.ndarray | None = None) -> np.ndarray:
        """The network's displacement (S, 24, 3) [m] for a pose, changed where it leaves hair inside the body."""
        if self._body is None:
            return displacement
        points = self.strands.rest + displacement
        resolved = resolve(points, self.collider(joints, shape), self.rest_distance)
        if resolved is points:
            return displacement
        moved = (resolved != points).any(axis=(1, 2)) & self.strands.valid
        result = displacement.copy()
        result[moved] = resolved[moved] - self.strands.rest[moved]
        return result


def resolve(points: np.ndarray, collider: Collider, rest_distance: np.ndarray, margin: float = MARGIN) -> np.ndarray:
    """Strands without vertices inside the body.

    Strands that touch nothing come back bit for bit. In the others each vertex, from the root on, aims at where the
    network put it, at its rest length from the one before, and slides around that one until it is clear. So a strand
    depends on itself and on the body only: neither the order of strands nor their division into chunks matters.

    Args:
        points: deformed strands (S, K, 3) [m], in the collider's space.
        collider: the body in this pose.
        rest_distance: signed distance of each vertex in the bind pose (S, K) [m]: hair that rests inside the body, or
            closer than the margin, is not pushed beyond where it rests.
        margin: clearance [m].

    Returns:
        (S, K, 3), of the type of `points`.
    """
    clear = np.minimum(rest_distance, margin, dtype=float)
    clear[:, :CLAMPED] = -np.inf
    free = np.flatnonzero(np.isfinite(clear).ravel())
    flat = points.reshape(-1, 3)
    near = free[collider.near(flat[free], BAND)]
    deep = np.zeros(clear.shape, bool)
    # A vertex that may rest inside must not count as a violation by the float32 rounding of the network's output.
    deep.ravel()[near] = collider.distance(flat[near], limit=margin)[0] < clear.ravel()[near] - 1e-5
    hit = np.flatnonzero(deep.any(axis=1))
    if not len(hit):
        return points
    result = np.array(points)
    result[hit] = _untangle(np.asarray(points[hit], float), collider, clear[hit], deep[hit])
    return result


def _untangle(wanted: np.ndarray, collider: Collider, clear: np.ndarray, deep: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(np.diff(wanted, axis=1), axis=2)
    result = wanted.copy()
    moved = np.zeros(len(wanted), bool)
    for i in range(CLAMPED, wanted.shape[1]):
        before, length = result[:, i - 1], lengths[:, i - 1, None]
        active = np.flatnonzero(moved | deep[:, i])
        # A vertex that had to give way drags the next ones along only as far as the lengths ask for.
        here = before[active] + length[active] * _unit(wanted[active, i] - before[active])
        todo = np.arange(len(active))
        for _ in range(ITERATIONS):
            rows = active[todo]
            distance, normal = collider.distance(here[todo])
            short = clear[rows, i] - distance
            still = short > 0
            if not still.any():
                break
            todo, rows = todo[still], rows[still]
            pushed = here[todo] + (1.05 * short[still] + 1e-5)[:, None] * normal[still]
            here[todo] = before[rows] + length[rows] * _unit(pushed - before[rows])
        result[active, i] = here
        moved[active] = True
    return result


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _within_reach(character: Character, strands: StrandSet) -> Body | None:
    """The part of the body that the hair could touch in some pose, with room for the neck to bend."""
    body = character.body
    length = float(np.max(strands.length[strands.valid], initial=0.0))
    roots = strands.rest[strands.valid, 0]
    if not len(roots):
        return None
    to_canonical = np.linalg.inv(character.canonical_to_bind)
    points = body.points @ to_canonical[:3, :3].T + to_canonical[:3, 3]
    low, high = roots.min(axis=0), roots.max(axis=0)
    near = np.linalg.norm(points - np.clip(points, low, high), axis=1) < length + 0.15
    faces = body.triangles[near[body.triangles].any(axis=1)]
    if not len(faces):
        return None
    used, triangles = np.unique(faces, return_inverse=True)
    return Body(
        body.points[used],
        triangles.reshape(-1, 3),
        body.joint_indices[used],
        body.joint_weights[used],
        {name: offsets[used] for name, offsets in body.shapes.items()},
    )
