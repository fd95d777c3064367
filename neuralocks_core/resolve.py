# SPDX-License-Identifier: Apache-2.0
"""Push hair out of the body after the network, with every segment's length kept."""

import numpy as np

from neuralocks_core.character import Body, Character
from neuralocks_core.collider import Collider
from neuralocks_core.head_field import HeadField, PosedBody
from neuralocks_core.strands import StrandSet

MARGIN = 0.001
"""Clearance that a pushed vertex gets [m]."""
ROUNDS = 5
"""Of finding the planes under a strand and laying it over them."""
CLAMPED = 2
"""Vertices at the root that never move."""
NEAR = 0.02
"""Distance [m] within which a vertex of a strand in trouble minds the surface."""


class Resolver:
    """Keeps one groom out of its character's body, frame by frame, in canonical space.

    Args:
        character: whose body the hair must stay out of; without a body nothing is done.
        strands: the groom at rest.
        shape: blend shape weights (B,) of the pose in which the groom rests.

    Attributes:
        body: the part of the body that the hair can reach, or None.
        at_rest: the collider in bind pose, if there is a body.
    """

    def __init__(self, character: Character, strands: StrandSet, shape: np.ndarray | None = None):
        self.character, self.strands = character, strands
        self.body = None if character.body is None else _within_reach(character, strands)
        self.at_rest: Collider | None = None
        if self.body is not None:
            to_canonical = np.linalg.inv(character.canonical_to_bind)
            points = self.body.shaped(shape) @ to_canonical[:3, :3].T + to_canonical[:3, 3]
            self.at_rest = Collider(points, self.body.triangles)
            self.rest_distance = self.at_rest.distance(strands.rest)[0]
            self._fields: dict[bytes, HeadField] = {}

    def collider(self, joints: np.ndarray, shape: np.ndarray | None = None) -> Collider | None:
        """The body that the hair can reach, posed by world joint transforms (J, 4, 4), in canonical space."""
        if self.body is None:
            return None
        to_canonical = np.linalg.inv(self.character.canonical_to_world(joints))
        skinning = to_canonical @ np.asarray(joints, float) @ self.character.inverse_bind
        return Collider(self.body.posed(skinning, shape), self.body.triangles)

    def _quick(self, joints: np.ndarray, shape: np.ndarray | None) -> PosedBody:
        """As `collider`, with what moves rigidly with the head looked up in a grid, made once for a body shape."""
        shape = None if shape is None else np.asarray(shape, float)
        key = b"" if shape is None else shape.tobytes()
        if key not in self._fields:
            if len(self._fields) > 8:
                self._fields.clear()
            to_canonical = np.linalg.inv(self.character.canonical_to_bind)
            points = self.body.shaped(shape) @ to_canonical[:3, :3].T + to_canonical[:3, 3]
            self._fields[key] = HeadField(points, self.body.triangles, _moves_with_head(self.character, self.body))
        to_canonical = np.linalg.inv(self.character.canonical_to_world(joints))
        posed = self.body.posed(to_canonical @ np.asarray(joints, float) @ self.character.inverse_bind, shape)
        return PosedBody(self._fields[key], posed)

    def displacement(self, displacement: np.ndarray, joints: np.ndarray, shape: np.ndarray | None = None) -> np.ndarray:
        """The network's displacement (S, 24, 3) [m] for a pose, changed where it leaves hair inside the body."""
        if self.body is None:
            return displacement
        points = self.strands.rest + displacement
        resolved = resolve(points, self._quick(joints, shape), self.rest_distance)
        if resolved is points:
            return displacement
        moved = (resolved != points).any(axis=(1, 2)) & self.strands.valid
        result = displacement.copy()
        result[moved] = resolved[moved] - self.strands.rest[moved]
        return result


def resolve(
    points: np.ndarray, collider: Collider | PosedBody, rest_distance: np.ndarray, margin: float = MARGIN
) -> np.ndarray:
    """Strands without vertices inside the body.

    Strands that touch nothing come back bit for bit. The others are laid over the planes of the surface under them,
    from the root on and with every length kept, until nothing is inside any more. A strand depends on itself and on the
    body only: neither the order of strands nor their division into chunks matters.

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
    # A vertex that may rest inside must not count as a violation by the float32 rounding of the network's output.
    low = clear - 1e-5
    hit = np.flatnonzero(_violates(points, collider, low, margin))
    if not len(hit):
        return points
    result = np.array(points)
    wanted, clear = np.asarray(points[hit], float), clear[hit]
    lengths = np.linalg.norm(np.diff(wanted, axis=1), axis=2)
    planes = _Planes(wanted.shape[:2])
    now, todo = wanted.copy(), np.arange(len(hit))
    for _ in range(ROUNDS):
        planes.look(collider, now, clear, todo)
        now[todo] = _laid(wanted[todo], lengths[todo], planes.normal[todo], planes.height[todo])
        todo = todo[_violates(now[todo], collider, clear[todo] - 0.5 * margin, margin)]
        if not len(todo):
            break
    result[hit] = now
    return result


class _Planes:
    """A plane under each vertex, n . x >= height, the latest one found."""

    def __init__(self, shape):
        self.normal, self.height = np.zeros((*shape, 3)), np.full(shape, -np.inf)

    def look(self, collider: Collider, points: np.ndarray, clear: np.ndarray, rows: np.ndarray) -> None:
        """Find the planes of these strands anew."""
        inside = points[rows, CLAMPED:]
        distance, normal = collider.distance(inside, limit=NEAR, proven=False)
        surface = (inside * normal).sum(axis=-1) - distance
        height = np.where(distance < NEAR, surface + clear[rows, CLAMPED:] * 1.02 + 2e-5, -np.inf)
        self.normal[rows, CLAMPED:], self.height[rows, CLAMPED:] = normal, height


def _laid(wanted: np.ndarray, lengths: np.ndarray, normal: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Strands (n, K, 3) as near to where they are wanted as their lengths and the planes under them let them be.

    From the root on, each segment aims at its wanted end. If that is under its plane, it takes the direction nearest to
    that which ends on the plane; straight away from the body if not even that reaches.
    """
    result = wanted.copy()
    free = np.ones(len(wanted), bool)
    for i in range(CLAMPED, wanted.shape[1]):
        before, length, n = result[:, i - 1], lengths[:, i - 1, None], normal[:, i]
        along = _unit(wanted[:, i] - before)
        up = ((height[:, i] - (n * before).sum(axis=1)) / np.maximum(length[:, 0], 1e-9))[:, None]
        rise = (along * n).sum(axis=1, keepdims=True)
        low = (rise < up)[:, 0]
        slope = np.clip(up, -1, 1)
        lifted = slope * n + np.sqrt(1 - slope**2) * _unit(along - rise * n)
        moved = before + length * np.where(low[:, None], lifted, along)
        free &= ~low
        # Up to the first vertex that must give way, a strand stays bit for bit.
        result[:, i] = np.where(free[:, None], wanted[:, i], moved)
    return result


def _violates(points: np.ndarray, collider: Collider, low: np.ndarray, margin: float) -> np.ndarray:
    """Which strands (S,) have a vertex nearer than `low` (S, K), or deeper inside."""
    flat, low = points.reshape(-1, 3), low.ravel()
    free = np.flatnonzero(np.isfinite(low))
    near = free[collider.near(flat[free], margin)]
    deep = np.zeros(low.shape, bool)
    deep[near] = collider.distance(flat[near], limit=margin, proven=False)[0] < low[near]
    return deep.reshape(points.shape[:2]).any(axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _moves_with_head(character: Character, body: Body) -> np.ndarray:
    """Which vertices (V,) follow the head joint and nothing else, so that they stand still in canonical space."""
    own = np.sum(body.joint_weights * (body.joint_indices == character.head), axis=1)
    return own > 1 - 1e-5


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
