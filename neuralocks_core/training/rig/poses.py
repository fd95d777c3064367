# SPDX-License-Identifier: Apache-2.0
"""Random neck poses and body shapes for rigged mesh hair, with what is near of the body around the head of each (paper section 4.4)."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from neuralocks_core.body.enclosed import proven_distances
from neuralocks_core.body.surface_samples import nearest
from neuralocks_core.models.runtime import cores
from neuralocks_core.progress import Progress, silent
from neuralocks_core.rig.network import held_features
from neuralocks_core.rig.rigging import HairRig
from neuralocks_core.rotation import from_vector
from neuralocks_core.training.rig.body import KEPT, BodyPatch

RANGE = np.radians([60.0, 80.0, 45.0])
"""Largest nod, turn and tilt of people's heads relative to the chest [rad]."""
_SIEVE = 5e-3
"""Points farther than this [m] outside the plane of the nearest place of the body are not measured exactly."""


@dataclass(frozen=True)
class Moments:
    """Moments of bodies in motion.

    Attributes:
        features: the network's inputs in each, (M, F) float32.
        skinning: posed @ inverse(bind) of every joint, (M, J, 4, 4).
    """

    features: np.ndarray
    skinning: np.ndarray


class PosePool:
    """Posed bodies to draw from; renewed bit by bit, so that no network memorises their shapes.

    Args:
        rig: hair and body.
        count: number of poses held at a time.
        rng: decides all of them.
        moments: of motion to draw the poses from; random necks if left out.

    Attributes:
        moment: the index of each pose's moment, (P,).
        relative: neck and upper chest relative to the head, from the bind pose, canonical, (P, 2, 3, 3).
        shapes: blend shape weights of each, (P, B).
    """

    def __init__(
        self,
        rig: HairRig,
        count: int,
        rng: np.random.Generator,
        moments: Moments | None = None,
    ):
        self.rig, self.count, self._rng, self._oldest, self._moments = rig, count, rng, 0, moments
        self.moment = np.zeros(count, int)
        self.relative = np.empty((count, 2, 3, 3))
        self._patch = BodyPatch.of(rig, KEPT) if len(rig.points) else None
        self.shapes = np.zeros((count, len(self._patch.body.shapes) if self._patch else 0))
        if self._patch:
            # Of a whole body of 90,000 vertices, 512 poses are half a gigabyte.
            self._read = np.empty((count, len(self._patch.read.points), 3), np.float32)
            self._index = np.empty((count, 4, KEPT), np.float32)
            self._joints = np.unique(self._patch.body.joint_indices)
            self._skinning = np.empty((count, len(self._joints), 4, 4))
        self.renew(count)

    @staticmethod
    def size(rig: HairRig) -> int:
        """About how many bytes a pose takes, at least 1."""
        patch = BodyPatch.of(rig, KEPT) if len(rig.points) else None
        return 1 if patch is None else 12 * len(patch.read.points) + 16 * KEPT

    @property
    def collides(self) -> bool:
        """Whether there is a body to collide with."""
        return self._patch is not None

    def renew(self, count: int) -> np.ndarray:
        """Replace the oldest poses by new ones; returns their indices (count,)."""
        character = self.rig.character
        rows = (self._oldest + np.arange(count)) % self.count
        self._oldest = (self._oldest + count) % self.count
        if self._moments is None:
            skinning = _random_skinning(character, count, self._rng)
        else:
            self.moment[rows] = self._rng.integers(0, len(self._moments.skinning), count)
            skinning = self._moments.skinning[self.moment[rows]]
        facing, head = character.facing, character.head
        indices = [character.humanoid.nearest(name) for name in ("neck", "upper_chest")]
        turns = np.swapaxes(skinning[:, None, head, :3, :3], -1, -2) @ skinning[:, indices, :3, :3]
        self.relative[rows] = facing @ turns @ facing.T
        if self._patch is None:
            return rows
        self.shapes[rows] = np.clip(self._rng.normal(0, 0.35, (count, self.shapes.shape[1])), -0.8, 0.8)
        skinning = np.linalg.inv(skinning[:, head] @ character.canonical_to_bind)[:, None] @ skinning
        self._skinning[rows] = skinning[:, self._joints]
        for row, matrices in zip(rows, skinning):
            self._read[row] = read = self._patch.read.posed(matrices, self.shapes[row])
            self._index[row] = self._patch.samples.index(read)
        return rows

    def body(self, pose: int) -> np.ndarray:
        """Vertices of the body around the head in a pose, (V, 3) float32 [m], canonical."""
        matrices = np.zeros((len(self.rig.character.skeleton.names), 4, 4))
        matrices[self._joints] = self._skinning[pose]
        return self._patch.body.posed(matrices, self.shapes[pose]).astype(np.float32)

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

    def situations(self, spec, poses: np.ndarray) -> np.ndarray:
        """The network's inputs at these poses' moments, or in the held poses under a random gravity, (n, F) float32."""
        if self._moments is not None:
            return self._moments.features[self.moment[poses]]
        return self.features(spec, poses, self.gravity(poses))

    def features(self, spec, poses: np.ndarray, gravity: np.ndarray) -> np.ndarray:
        """The network's inputs for these poses, (n, F) float32."""
        return held_features(spec, self.relative[poses], gravity)

    def planes(self, poses: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Plane of the body near each point (n, V, 3), across the way there: normals (n, V, 3) and offsets (n, V), distance
        = n.x - d.
        """
        found = np.concatenate([nearest(self._index[pose], some) for pose, some in zip(poses, points)])
        normals, offsets = self._patch.samples.planes(
            found, points.reshape(-1, 3), self._read, np.repeat(poses, points.shape[1])
        )
        return normals.reshape(points.shape), offsets.reshape(points.shape[:2])

    def distances(self, poses: np.ndarray, points: np.ndarray, progress: Progress = silent) -> np.ndarray:
        """Signed distances (n, V) [m] to the body, exact where a point (n, V, 3) may be inside, 1 elsewhere."""
        result = np.ones(points.shape[:2])

        def measure(row: int) -> None:
            # Of all poses at once, planes take kilobytes for each point: gigabytes for a mesh of 2,000 vertices in 1,000 poses.
            normals, offsets = self.planes(poses[row : row + 1], points[row : row + 1])
            near = np.einsum("vi,vi->v", normals[0], points[row]) - offsets[0] < _SIEVE
            if near.any():
                body = self.body(poses[row])
                result[row, near] = proven_distances(body, self._patch.body.triangles, points[row, near])

        with ThreadPoolExecutor(cores()) as pool:
            for done, _ in enumerate(pool.map(measure, range(len(points))), 1):
                progress(done, len(points), "measuring what lies in the body")
        return result


def _random_skinning(character, count, rng) -> np.ndarray:
    """posed @ inverse(bind) of every joint (P, J, 4, 4): head and neck turn, the arms hang to varying degrees."""
    turns = {}
    # Uniform in an ellipsoid a tenth larger than what a neck can do; no neck reaches the corners of its box.
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
