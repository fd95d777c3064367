# SPDX-License-Identifier: Apache-2.0
"""Push hair out of the body after the network, with every segment's length kept."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from neuralocks_core.body.collider import Collider
from neuralocks_core.body.enclosed import enclosed
from neuralocks_core.body.near_body import NearBody, PosedBody
from neuralocks_core.character import Character
from neuralocks_core.deformation.laying import (
    ALWAYS,
    CHECKED,
    MARGIN,
    NEVER,
    clearance,
    keep_out,
    resolved,
    rest_distance,
)
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.motion import Clip
from neuralocks_core.skinned_body import Body
from neuralocks_core.strands.strand_set import CLAMPED, StrandSet

STILL = 1e-3
"""Skin that moves by less than this relative to the head [m] counts as still."""
HEAD = 0.999
"""Skin with at least this share of its weights on the joint that carries the hair, and those below it, is the head's."""
STEP, ROOM = 0.1, 0.1
"""The ball that hair can reach is enlarged [m]: to the next multiple of STEP, plus ROOM."""
DEEP = 0.02
"""A strand that rests deeper than this [m] is checked in every frame: its next vertices may lie where nothing is known."""
BATCH = 1024
"""Strands checked and pushed together, without threads."""
WORN = 0.01
"""A root deeper in the body than this [m] is not on its skin, but under something worn."""


def reach(character: Character, strands: StrandSet) -> float:
    """Radius [m] about the middle of the head in which the groom could touch the body in some pose, with room for the neck to
    bend; 0 if it has no strand. In steps, so that the grooms of a head share it and what is built from it.
    """
    if not strands.valid.any():
        return 0.0
    roots, step = strands.rest[strands.valid, 0] - character.head_centre, STEP * character.times_human
    far = (np.linalg.norm(roots, axis=1) + strands.length[strands.valid]).max()
    return float(step * np.ceil(far / step) + ROOM * character.times_human)


class Resolver:
    """Keeps one groom out of its character's body, frame by frame, in canonical space.

    A giant is shrunk to a person's size first: otherwise its grids would have a thousand times as many nodes, and what counts as
    near, thin or deep on a person would be tiny on it. The factor is a power of two, which rounds no number: what is not pushed
    stays the same, bit for bit.

    Args:
        character: whose body the hair must stay out of; without a body nothing is done.
        strands: the groom at rest.
        clip: the motion to come. Skin of the head that hardly moves relative to it is looked up in a grid built once, and blend
            shapes that do not change in it are part of the rest pose.

    Attributes:
        body: the part of the body that the hair can reach, or None.
    """

    def __init__(self, character: Character, strands: StrandSet, clip: Clip):
        self.character, self.strands, self._clip = character, strands, clip
        self.body = None if character.body is None else _within_reach(character, strands)
        self._size = np.float32(character.times_human)
        self._rest = strands.rest if self._size == 1 else strands.rest / self._size

    @cached_property
    def at_rest(self) -> Collider | None:
        """The exact collider in bind pose, if there is a body."""
        if self.body is None:
            return None
        return Collider(self.character.canonical(self.body.shaped(self._constant)), self.body.triangles)

    def collider(self, joints: np.ndarray, shape: np.ndarray | None = None) -> Collider | None:
        """The exact collider of one pose, world joint transforms (J, 4, 4), in canonical space: for measurements."""
        if self.body is None:
            return None
        return Collider(self.body.posed(self.character.skinning(joints), shape), self.body.triangles)

    def rough_distance(self, points: np.ndarray, joints: np.ndarray, shape: np.ndarray) -> np.ndarray:
        """Signed distance (N,) [m] of points (N, 3) to the body in a pose, as hair is resolved by: within about a millimetre
        near the skin, infinite where it is not near and deeper than a few centimetres in skin that moves.

        Args:
            points: canonical [m].
            joints: world joint transforms (J, 4, 4).
            shape: blend shape weights (B,).
        """
        points = np.asarray(points, np.float32) / self._size
        return self._posed(joints, shape, points.min(axis=0), points.max(axis=0)).distance(points)[0] * self._size

    def prepare(self) -> None:
        """Build now, once for all frames, what the first frame would otherwise wait for."""
        if self.body is not None:
            _ = self.clear

    def apply(
        self,
        displacement: np.ndarray,
        joints: np.ndarray,
        shape: np.ndarray | None = None,
        by_chunk: Callable | None = None,
    ) -> None:
        """Change the network's displacement (S, 24, 3) float32 [m] for a pose where it leaves hair inside the body.

        Args:
            displacement: canonical, changed in place.
            joints: world joint transforms (J, 4, 4).
            shape: blend shape weights (B,).
            by_chunk: calls a function with slices of so many strands, possibly on several threads, such as `StrandModel.by_chunk`;
                the result does not depend on them.

        Raises:
            NeuralocksError: an array has the wrong shape.
        """
        if self.body is None or not len(displacement):
            return
        for name, array, wanted in (
            ("displacement", displacement, self.strands.rest.shape),
            ("joints", joints, self.character.skeleton.bind.shape),
        ):
            if np.shape(array) != wanted:
                raise NeuralocksError(f"{name}: is of shape {np.shape(array)}; give {wanted}")
        if self._size != 1:
            displacement /= self._size
        self._push(displacement, joints, shape, by_chunk or _one_by_one)
        if self._size != 1:
            displacement *= self._size

    def freed(self) -> np.ndarray:
        """Displacement (S, 24, 3) float32 [m], canonical, that lays strands over the body that they rest in. Their roots stay, and
        so does hair under something worn, and hair in free air below the rim of an open mesh, a scalp without a neck.
        """
        moved = np.zeros_like(self._rest)
        if self.body is None:
            return moved
        body, distance = self._rested()
        inside = np.flatnonzero((distance[:, 1:] < 0).any(axis=1) & (distance[:, 0] > -WORN) & self.strands.valid)
        inside = inside[self._truly(inside, distance[inside])]
        for i in range(0, len(inside), BATCH):
            rows = inside[i : i + BATCH]
            clear = np.full(distance[rows].shape, MARGIN, np.float32)
            clear[:, 0] = -np.inf
            moved[rows] = resolved(self._rest[rows], body, clear) - self._rest[rows]
        return moved * self._size

    def _truly(self, strands: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Which strands' deepest vertex the body encloses, (n,) of their indices and distances (n, 24) [m] at a person's size, if it
        seems deep: below the rim of an open mesh, the nearest skin has free air on its inner side.
        """
        deep, deepest = distance.min(axis=1, initial=0) < -DEEP, distance.argmin(axis=1)
        places = self.strands.rest[strands, deepest][deep]
        vertices = self.character.canonical(self.character.body.shaped(self._constant))
        truly = np.ones(len(strands), bool)
        truly[deep] = enclosed(places, vertices, self.character.body.triangles)
        return truly

    def _push(self, displacement: np.ndarray, joints: np.ndarray, shape: np.ndarray | None, by_chunk: Callable) -> None:
        rest, clear, watch = self._rest, self.clear, self._watch
        body = self._posed(joints, shape, *_within(self._reach + _reached(displacement)))
        by_chunk(lambda s: keep_out(displacement[s], rest[s], clear[s], watch[s], body), len(rest))

    def _posed(self, joints, shape, low, high) -> PosedBody:
        changed = None if shape is None else np.asarray(shape, float) - self._constant
        return self._near.posed(self._shrunk(self.character.skinning(joints)), changed, low, high)

    def _shrunk(self, transforms: np.ndarray) -> np.ndarray:
        """Transforms (..., 4, 4) into canonical space, followed by scaling to a person's size."""
        result = transforms.copy()
        result[..., :3, :] /= self._size
        return result

    @cached_property
    def clear(self) -> np.ndarray:
        """Distance (S, 24) float32 [m] that each vertex must keep, at a person's size."""
        return clearance(self._rested()[1])

    def _rested(self) -> tuple[PosedBody, np.ndarray]:
        """The body in bind pose, and each vertex's signed distance to it there (S, 24) [m], at a person's size."""
        points = self._rest
        body = self._posed(self.character.skeleton.bind, self._constant, *_within(_reached(points)))
        parts = [rest_distance(points[i : i + BATCH], body) for i in range(0, len(points), BATCH)]
        return body, np.concatenate(parts)

    @cached_property
    def _watch(self) -> np.ndarray:
        deep = (self.clear[:, CLAMPED:] < -DEEP).any(axis=1)
        return np.where(self.strands.valid, np.where(deep, ALWAYS, CHECKED), NEVER).astype(np.uint8)

    @cached_property
    def _reach(self) -> np.ndarray:
        return _reached(self._rest)

    def serves(self, clip: Clip) -> bool:
        """Whether a resolver made for this clip would give the same results."""
        if self.body is None:
            return True
        same = np.array_equal(clip.shape[:1], self._clip.shape[:1])
        return same and np.array_equal(_stands_still(self.character, self.body, clip), self._still)

    @cached_property
    def _still(self) -> np.ndarray:
        return _stands_still(self.character, self.body, self._clip)

    @cached_property
    def _near(self) -> NearBody:
        body, character, strands, still = self.body, self.character, self.strands, self._still
        if body.shapes:
            body = replace(body, points=body.shaped(self._constant))
        length = float(strands.length[strands.valid].max() / self._size)
        roots = self._rest[strands.valid, 0]
        low, high = roots.min(axis=0) - length, roots.max(axis=0) + length
        return NearBody(body, self._shrunk(character.bind_to_canonical), still, low, high)

    @property
    def _constant(self) -> np.ndarray:
        return self._clip.shape[0]


def _reached(points: np.ndarray) -> np.ndarray:
    """Least and greatest coordinates (2, K, 3) of each vertex of strands (S, K, 3)."""
    rows = points.reshape(len(points), -1)  # comparing rows of numbers is much faster than comparing triples
    return np.stack([rows.min(axis=0), rows.max(axis=0)]).reshape(2, -1, 3)


def _within(reached: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Low and high corner (3,) of all vertices, from those of each (2, K, 3)."""
    return reached[0].min(axis=0), reached[1].max(axis=0)


def _one_by_one(function: Callable[[slice], None], count: int) -> None:
    for i in range(0, count, BATCH):
        function(slice(i, min(i + BATCH, count)))


def _stands_still(character: Character, body: Body, clip: Clip) -> np.ndarray:
    """Which vertices (V,) of the head move by less than STILL relative to it, by a bound from each joint's largest motion, and are
    moved by no blend shape. Those of a trunk that stands still do not count: a grid around all of it takes seconds to build.
    """
    shift = turn = np.zeros(len(character.skeleton.names))
    for row, joints in enumerate(clip.joints):
        if row and np.array_equal(joints, clip.joints[row - 1]):  # shots go on for long after an animation
            continue
        off = character.skinning(joints) @ character.canonical_to_bind - np.eye(4)
        turn = np.maximum(turn, np.sqrt(np.square(off[:, :3, :3]).sum(axis=(1, 2))))
        shift = np.maximum(shift, np.linalg.norm(off[:, :3, 3], axis=1))
    far = np.linalg.norm(character.canonical(body.points), axis=1)
    each = turn[body.joint_indices] * far[:, None] + shift[body.joint_indices]
    still = np.sum(body.joint_weights * each, axis=1) < STILL * character.times_human
    on_head = character.carrying_joint == character.head
    head = character.of_head if on_head else character.skeleton.below(character.carrying_joint)
    still &= body.weight_on(head) > HEAD
    for offsets, varies in zip(body.shapes.values(), np.ptp(clip.shape, axis=0) > 1e-6):
        if varies:
            still &= ~(np.abs(offsets) > 1e-5).any(axis=1)
    return still


def _within_reach(character: Character, strands: StrandSet) -> Body | None:
    """The part of the body within `reach`."""
    body = character.body
    off = np.linalg.norm(character.canonical(body.points) - character.head_centre, axis=1)
    near = off < reach(character, strands)
    faces = body.triangles[near[body.triangles].any(axis=1)]
    return body.only(faces) if len(faces) else None
