# SPDX-License-Identifier: Apache-2.0
"""Random neck poses and body shapes for rigged mesh hair, with the body around the head of each (paper section 4.4)."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from neuralocks_core.collider import Collider
from neuralocks_core.enclosed import proven_distances
from neuralocks_core.mesh import vertex_normals
from neuralocks_core.progress import Progress, silent
from neuralocks_core.rig.network import held_features
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rotation import from_vector
from neuralocks_core.runtime import cores

RANGE = np.radians([60.0, 80.0, 45.0])
"""Most nod, turn and tilt of the head against the chest that people have [rad]."""
_SIEVE = 5e-3
"""Points farther than this [m] outside the plane of the nearest body vertex are not asked for exactly."""
_FEW = 128
"""Points for which the nearest body vertex is found by comparing all: sooner than a tree is made and asked."""


class PosePool:
    """Posed bodies to draw from; renewed bit by bit, so that no network learns their shapes by heart.

    Args:
        rig: hair and body.
        count: how many poses are held at a time.
        rng: decides all of them.
        most_points: body vertices kept of each (nearest-vertex planes need no more).
        whole: keep each whole body around the head too, for exact distances.
        moving: moments of motion to draw the poses from, posed @ inverse(bind) of every joint, (M, J, 4, 4); random
            necks if left out.

    Attributes:
        moment: which of these each pose is, (P,).
        relative: neck and upper chest relative to the head, since bind, canonical, (P, 2, 3, 3).
        shapes: blend shape weights of each, (P, B).
        bodies: with `whole`, vertices of the body around the head of each (V, 3) float32 [m], canonical; else None.
    """

    def __init__(
        self,
        rig: HairRig,
        count: int,
        rng: np.random.Generator,
        most_points: int = 2000,
        whole: bool = False,
        moving: np.ndarray | None = None,
    ):
        self.rig, self.count, self._rng, self._oldest, self._moving = rig, count, rng, 0, moving
        self.moment = np.zeros(count, int)
        self.relative = np.empty((count, 2, 3, 3))
        self._patch = _BodyPatch(rig, rng, most_points) if rig.character.body is not None and len(rig.points) else None
        self.shapes = np.zeros((count, len(self._patch.offsets) if self._patch else 0))
        self.bodies = [None] * count if self._patch and whole else None
        kept = len(self._patch.kept) if self._patch else 0
        self._normals = np.empty((count, kept, 3), np.float32)
        # x, y, z and x.x of each body vertex: a matrix product with (-2 p, 1) tells which is nearest to p.
        self._points = np.empty((count, 4, kept), np.float32)
        self.renew(count)

    @property
    def collides(self) -> bool:
        """Whether there is a body to collide with."""
        return self._patch is not None

    def renew(self, count: int) -> np.ndarray:
        """Put new poses in the place of the oldest; which these were, (count,)."""
        character = self.rig.character
        rows = (self._oldest + np.arange(count)) % self.count
        self._oldest = (self._oldest + count) % self.count
        if self._moving is None:
            skinning = _random_skinning(character, count, self._rng)
        else:
            self.moment[rows] = self._rng.integers(0, len(self._moving), count)
            skinning = self._moving[self.moment[rows]]
        facing, head = character.facing, character.head
        indices = [character.humanoid.nearest(name) for name in ("neck", "upper_chest")]
        turns = np.swapaxes(skinning[:, None, head, :3, :3], -1, -2) @ skinning[:, indices, :3, :3]
        self.relative[rows] = facing @ turns @ facing.T
        if self._patch is None:
            return rows
        self.shapes[rows] = np.clip(self._rng.normal(0, 0.35, (count, self.shapes.shape[1])), -0.8, 0.8)
        skinning = np.linalg.inv(skinning[:, head] @ character.canonical_to_bind)[:, None] @ skinning
        for row, matrices in zip(rows, skinning):
            body = self._patch.posed(matrices, self.shapes[row])
            points = body[self._patch.kept]
            self._points[row, :3], self._points[row, 3] = points.T, np.square(points).sum(axis=1)
            self._normals[row] = self._patch.normals(body)
            if self.bodies is not None:
                self.bodies[row] = body
        return rows

    def gravity(self, poses: np.ndarray) -> np.ndarray:
        """Random directions of gravity in the head's frame (n, 3): the trunk leans, sometimes lies, seldom hangs
        upside down.
        """
        count = len(poses)
        lean = np.abs(self._rng.normal(0, np.radians(25), count))
        lean = np.where(self._rng.random(count) < 0.08, self._rng.uniform(0, np.pi, count), lean)
        around = self._rng.uniform(0, 2 * np.pi, count)
        axis = np.stack([np.cos(around), 0 * around, np.sin(around)], axis=1)
        trunk = np.einsum("nji,j->ni", from_vector(axis * lean[:, None]), [0.0, -1.0, 0.0])
        return np.einsum("nij,nj->ni", self.relative[poses, 1], trunk)

    def features(self, spec, poses: np.ndarray, gravity: np.ndarray) -> np.ndarray:
        """What the network reads of these poses (n, F) float32."""
        return held_features(spec, self.relative[poses], gravity)

    def planes(self, poses: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Plane of the body vertex nearest to each point (n, V, 3): normals (n, V, 3) and offsets (n, V), distance
        = n.x - d.
        """
        normals, offsets = np.empty_like(points), np.empty(points.shape[:2], points.dtype)
        for row, pose in enumerate(poses):
            nearest = _nearest(points[row], self._points[pose])
            normals[row] = self._normals[pose, nearest]
            offsets[row] = np.einsum("vi,iv->v", normals[row], self._points[pose, :3][:, nearest])
            # Where the rest of the body was cut off, a plane says nothing about inside and outside.
            offsets[row][self._patch.rim[nearest]] = -1e3
        return normals, offsets

    def distances(self, poses: np.ndarray, points: np.ndarray, progress: Progress = silent) -> np.ndarray:
        """Signed distances (n, V) [m] to the body, exact where a point (n, V, 3) may be in it, 1 elsewhere; needs `whole`."""
        normals, offsets = self.planes(poses, points)
        near = np.einsum("nvi,nvi->nv", normals, points) - offsets < _SIEVE
        result = np.ones(near.shape)

        def measure(row: int) -> None:
            result[row, near[row]] = proven_distances(
                self.bodies[poses[row]], self._patch.triangles, points[row][near[row]]
            )

        with ThreadPoolExecutor(cores()) as pool:
            rows = np.flatnonzero(near.any(axis=1))
            for done, _ in enumerate(pool.map(measure, rows), 1):
                progress(done, len(rows), "measuring what lies in the body")
        return result


def _nearest(points: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Which of the body's vertices, columns x, y, z, x.x of (4, n), is nearest to each of the points (V, 3)."""
    if len(points) > _FEW:
        return cKDTree(body[:3].T, balanced_tree=False, compact_nodes=False).query(points)[1]
    asked = np.ones((len(points), 4), np.float32)
    asked[:, :3] = -2 * points
    return (asked @ body).argmin(axis=1)


class _BodyPatch:
    """The part of the body around the head that hair can reach.

    Attributes:
        triangles: into its vertices.
        kept: vertices whose planes are used.
        rim: which of these touch the cut, (kept,).
        offsets: of its blend shapes, (B, vertices, 3).
    """

    def __init__(self, rig: HairRig, rng: np.random.Generator, most_points: int):
        body, character = rig.character.body, rig.character
        inside = rig.near(character.canonical(body.points))[body.triangles].all(axis=1)
        used = np.unique(body.triangles[inside])
        place = np.zeros(len(body.points), int)
        place[used] = np.arange(len(used))
        self.triangles = place[body.triangles[inside]]
        self.points = body.points[used].astype(np.float32)
        joints, shares = body.joint_indices[used], body.joint_weights[used].astype(np.float32)
        rows = np.repeat(np.arange(len(used)), joints.shape[1])
        self.weights = csr_array((shares.ravel(), (rows, joints.ravel())), (len(used), len(character.skeleton.names)))
        shapes = list(body.shapes.values())
        offsets = np.stack([s[used] for s in shapes]) if shapes else np.zeros((0, len(used), 3))
        # The hair was fitted to its own head: other bodies vary below it.
        on_head = np.sum(shares * (joints == character.head), axis=1)
        mean = offsets[:, on_head > 0.9].mean(axis=1, keepdims=True) if (on_head > 0.9).any() else 0.0
        self.offsets = ((offsets - mean) * (1 - on_head)[:, None]).astype(np.float32)
        self.kept = np.sort(rng.permutation(len(used))[:most_points])
        corners = self.triangles.ravel()
        around = csr_array(
            (np.ones(len(corners)), (corners, np.arange(len(corners)) // 3)), (len(used), len(self.triangles))
        )
        self._around = around.astype(np.float32)[self.kept]
        cut = np.zeros(len(body.points), bool)
        cut[body.triangles[~inside]] = True
        self.rim = cut[used][self.kept]

    def posed(self, skinning: np.ndarray, shape: np.ndarray) -> np.ndarray:
        """Vertices (V, 3) float32 under skinning matrices (J, 4, 4) and blend shape weights (B,)."""
        shaped = self.points + np.tensordot(shape.astype(np.float32), self.offsets, 1)
        blended = (self.weights @ skinning[:, :3].reshape(len(skinning), 12).astype(np.float32)).reshape(-1, 3, 4)
        return np.einsum("vxy,vy->vx", blended[:, :, :3], shaped) + blended[:, :, 3]

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Unit normals (kept, 3) float32 of vertices (V, 3), as `vertex_normals`."""
        a, b, c = (points[corner] for corner in self.triangles.T)
        total = self._around @ np.cross(b - a, c - a)
        return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)


def posed_distances(rig: HairRig, joints: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Signed distances (T, V) [m] of points (T, V, 3), canonical, to the body under world joint transforms (T, J, 4, 4)."""
    character = rig.character
    patch = _BodyPatch(rig, np.random.default_rng(0), 1)
    skinning = np.linalg.inv(character.canonical_to_world(joints))[:, None] @ joints @ character.inverse_bind
    shape = np.zeros(len(patch.offsets))
    return np.stack([proven_distances(patch.posed(m, shape), patch.triangles, p) for m, p in zip(skinning, points)])


def rest_clearance(rig: HairRig, points: np.ndarray) -> np.ndarray:
    """Distance (V,) [m] that canonical points (V, 3) may come near the body: what they have in bind pose, exactly or by
    the nearest body vertex's plane, whichever is less.

    Poses are measured by such planes. Over the faces of a coarse body these are centimetres off, and hair was thrown
    from where the artist had put it.
    """
    exact, body = rest_distances(rig, points), rig.character.body
    if body is None or not len(points):
        return exact
    used = np.unique(body.triangles)
    vertices = rig.character.canonical(body.points)
    normals = vertex_normals(vertices, body.triangles)[used]
    nearest = cKDTree(vertices[used]).query(points)[1]
    return np.minimum(exact, np.einsum("vi,vi->v", points - vertices[used][nearest], normals[nearest]))


def rest_distances(rig: HairRig, points: np.ndarray) -> np.ndarray:
    """Signed distances (V,) [m] of canonical points (V, 3) to the body in bind pose; infinite without one."""
    body = rig.character.body
    if body is None:
        return np.full(len(points), np.inf)
    return Collider(rig.character.canonical(rig.character.body.points), body.triangles).distance(points)[0]


def _random_skinning(character, count, rng) -> np.ndarray:
    """posed @ inverse(bind) of every joint (P, J, 4, 4): head and neck turn, the arms hang more or less."""
    turns = {}
    # Evenly in an ellipsoid that is a tenth larger than what a neck can do; its corners no neck can reach.
    direction = rng.normal(size=(count, 3))
    direction *= (1.1 * rng.random(count) ** (1 / 3) / np.linalg.norm(direction, axis=1))[:, None]
    total = RANGE * direction
    share = rng.uniform(0.2, 0.6, (count, 1)) if "neck" in character.humanoid else np.zeros((count, 1))
    wobble = rng.normal(0, 0.08, (count, 3))
    turns[character.humanoid.nearest("neck")] = share * total + wobble
    head = (1 - share) * total - wobble
    if character.humanoid.nearest("neck") == character.head:
        head = total
    turns[character.head] = head
    for side, sign in (("left", 1), ("right", -1)):
        arm, elbow = character.humanoid.get(f"{side}_upper_arm"), character.humanoid.get(f"{side}_lower_arm")
        if arm is not None and elbow is not None:
            bone = character.facing @ (character.skeleton.bind[elbow, :3, 3] - character.skeleton.bind[arm, :3, 3])
            down = np.arctan2(-bone[1], sign * bone[0])
            turns[arm] = np.outer(rng.uniform(np.radians(15), np.radians(80), count) - down, [0, 0, -sign])
    skinning = np.empty((count, len(character.skeleton.names), 4, 4))
    for joint, parent in enumerate(character.skeleton.parents):
        carrier = skinning[:, parent] if parent >= 0 else np.broadcast_to(np.eye(4), (count, 4, 4))
        if joint not in turns:
            skinning[:, joint] = carrier
            continue
        own = np.broadcast_to(np.eye(4), (count, 4, 4)).copy()
        own[:, :3, :3] = character.facing.T @ from_vector(turns[joint]) @ character.facing
        origin = character.skeleton.bind[joint, :3, 3]
        own[:, :3, 3] = origin - own[:, :3, :3] @ origin
        skinning[:, joint] = carrier @ own
    return skinning


def body_around(rig: HairRig, joints: np.ndarray, most_points: int = 1000) -> tuple[np.ndarray, np.ndarray] | None:
    """Body vertices around the head for world joint transforms (T, J, 4, 4): points and normals (T, P, 3) in
    canonical space of the head; None if there are none.
    """
    body, character = rig.character.body, rig.character
    if body is None:
        return None
    canonical = rig.character.canonical(rig.character.body.points)
    reach = np.linalg.norm(rig.chains.origins, axis=1).max() + rig.chains.lengths.max() + 0.1
    used = np.isin(np.arange(len(canonical)), body.triangles) & (np.linalg.norm(canonical, axis=1) < reach)
    near = np.flatnonzero(used)
    if not len(near):
        return None
    chosen = np.sort(np.random.default_rng(0).permutation(near)[:most_points])
    normals = vertex_normals(body.points, body.triangles)[chosen]
    to_head = np.linalg.inv(character.canonical_to_world(joints))
    skinning = to_head[:, None] @ joints @ character.inverse_bind
    points, turned = np.empty((2, len(joints), len(chosen), 3), np.float32)
    for row, matrices in enumerate(skinning):
        blended = np.einsum("vi,vixy->vxy", body.joint_weights[chosen], matrices[body.joint_indices[chosen], :3])
        points[row] = np.einsum("vxy,vy->vx", blended[:, :, :3], body.points[chosen]) + blended[:, :, 3]
        turned[row] = np.einsum("vxy,vy->vx", blended[:, :, :3], normals)
    return points, turned / np.linalg.norm(turned, axis=-1, keepdims=True)
