# SPDX-License-Identifier: Apache-2.0
"""A character: its skeleton, and which joint is which, with its body."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from neuralocks_core.anatomy.hierarchy import copies
from neuralocks_core.anatomy.humanoid import Humanoid, find_humanoid
from neuralocks_core.anatomy.joint_names import own_names
from neuralocks_core.anatomy.own_skin import own_skin
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import inverse, rotation_part, transformed
from neuralocks_core.skinned_body import Body

HEAD_WIDTHS = (0.08, 0.6)
"""A head's width between these [m] is believed; others suggest a wrong unit."""
COMMON_WIDTH = 0.15
"""Typical width of a person's head [m]."""
LEAST_SKIN = 20
"""A head with fewer vertices cannot be measured."""
MOVED = 0.001
"""A blend shape that moves skin by less than this [m] counts as not moving it, since files round the offsets of all points."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints in bind pose, parents before children.

    Attributes:
        names: unique joint paths, (J).
        parents: index of each joint's parent, -1 for a root, (J,) int.
        bind: world transforms of the bind pose, (J, 4, 4) [m].
    """

    names: tuple[str, ...]
    parents: np.ndarray
    bind: np.ndarray

    def __post_init__(self):
        if np.mod(np.asarray(self.parents, float), 1).any():
            raise NeuralocksError("skeleton: a parent is not a whole number; give the index of each joint's parent")
        object.__setattr__(self, "names", tuple(self.names))
        object.__setattr__(self, "parents", np.asarray(self.parents, int))
        object.__setattr__(self, "bind", np.asarray(self.bind, float))
        count = len(self.names)
        if not count:
            raise NeuralocksError("skeleton: it has no joints; choose a skeleton with a head joint")
        if len(set(self.names)) != count:
            raise NeuralocksError("skeleton: two joints have the same path; make joint paths unique")
        if self.parents.shape != (count,) or (self.parents >= np.arange(count)).any() or self.parents.min() < -1:
            raise NeuralocksError("skeleton: a joint comes before its parent; order the joints root first")
        if self.bind.shape != (count, 4, 4) or not np.isfinite(self.bind).all():
            raise NeuralocksError(f"skeleton: needs {count} finite bind transforms; re-export it with its bind pose")
        if not np.linalg.det(self.bind[:, :3, :3]).all():
            raise NeuralocksError("skeleton: the bind transform of a joint has zero scale; repair it")

    @cached_property
    def children(self) -> list[list[int]]:
        """Direct children of each joint."""
        result = [[] for _ in self.names]
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                result[parent].append(joint)
        return result

    def below(self, *joints: int) -> np.ndarray:
        """Which joints (J,) bool are one of these or below one."""
        result, these = [False] * len(self.names), set(joints)
        for other, parent in enumerate(self.parents.tolist()):
            result[other] = other in these or (parent >= 0 and result[parent])
        return np.array(result)


def levels(parents: np.ndarray) -> list[np.ndarray]:
    """Joints without a parent, their children, and so on, so that each level is posed at once; parents (J,) come first."""
    depth = np.zeros(len(parents), int)
    for joint, parent in enumerate(parents):
        depth[joint] = depth[parent] + 1 if parent >= 0 else 0
    return [np.flatnonzero(depth == level) for level in range(depth.max(initial=-1) + 1)]


@dataclass(frozen=True, eq=False)
class Character:
    """A skeleton with its body and the meaning of its joints.

    Attributes:
        skeleton: the joints.
        body: the surface that hair rests on; None leaves the hair without a collider and with average measures.
        humanoid: semantic names of joints; found by name and hierarchy if left out.
        carrier: joint that carries the hair, if it is not the head but below it, such as the jaw for a beard. For this hair, the
            head then moves with that joint; canonical space is still the head's.
    """

    skeleton: Skeleton
    body: Body | None = None
    humanoid: Humanoid = None
    carrier: int | None = None

    def __post_init__(self):
        if self.humanoid is None:
            humanoid = find_humanoid(self.skeleton.names, self.skeleton.parents, self.skeleton.bind[:, :3, 3])
            object.__setattr__(self, "humanoid", humanoid)

    @property
    def head(self) -> int:
        """Index of the head's joint."""
        return self.humanoid["head"]

    @property
    def carrying_joint(self) -> int:
        """Index of the joint that carries the hair."""
        return self.head if self.carrier is None else self.carrier

    @cached_property
    def own_names(self) -> list[str]:
        """What each joint (J) is called without its parents' names and the rig's; see `joint_names.own_names`."""
        return own_names(self.skeleton.names, self.humanoid.get("head"))

    @cached_property
    def inverse_bind(self) -> np.ndarray:
        """(J, 4, 4)."""
        return np.linalg.inv(self.skeleton.bind)

    @cached_property
    def sides(self) -> tuple[int, int] | None:
        """The left and the right joint that tell which way the bind pose faces, if there are any."""
        bind = self.skeleton.bind[:, :3, 3]
        for part in ("upper_arm", "shoulder", "upper_leg", "eye"):
            left, right = self.humanoid.get(f"left_{part}"), self.humanoid.get(f"right_{part}")
            if left is not None and right is not None and left != right:
                x, _, z = bind[left] - bind[right]
                if np.hypot(x, z) > 1e-4:
                    return left, right
        return None

    @cached_property
    def facing(self) -> np.ndarray:
        """Rotation (3, 3) about Y that turns the bind pose to face +Z, judged by its left and right joints."""
        if self.sides is None:
            return np.eye(3)
        left, right = self.skeleton.bind[list(self.sides), :3, 3]
        x, _, z = left - right
        c, s = np.array([x, z]) / np.hypot(x, z)
        return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])

    @property
    def facing_angle(self) -> float:
        """By how much `facing` turns about +Y [degrees], more than -180 and at most 180."""
        return float(np.degrees(np.arctan2(self.facing[0, 2], self.facing[0, 0])))

    @property
    def collar(self) -> tuple[float, float, float] | None:
        """In bind pose [m], heights of the left shoulder and of the neck, lower first, and how far aside of the neck the shoulder
        is; None if joints do not tell.
        """
        joints = self.humanoid.get("left_upper_arm"), self.humanoid.get("neck")
        if None in joints:
            return None
        shoulder, neck = self.skeleton.bind[list(joints), :3, 3]
        return *sorted((float(shoulder[1]), float(neck[1]))), abs(float((self.facing @ (shoulder - neck))[0]))

    @cached_property
    def canonical_to_bind(self) -> np.ndarray:
        """Transform (4, 4) from canonical space (origin at the head joint, +Z face) to bind world."""
        transform = np.eye(4)
        transform[:3, :3] = self.facing.T
        transform[:3, 3] = self.skeleton.bind[self.head, :3, 3]
        return transform

    @cached_property
    def bind_to_canonical(self) -> np.ndarray:
        """Transform (4, 4) from bind world to canonical space."""
        return np.linalg.inv(self.canonical_to_bind)

    def canonical(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) of the bind pose [m], world, in canonical space."""
        return transformed(points, self.bind_to_canonical)

    def carrying(self, joints: np.ndarray) -> np.ndarray:
        """Rigid transforms (..., 4, 4), bind world to posed world, with which its joint carries the groom.

        `joints` (..., J, 4, 4) are world transforms.
        """
        joints = np.asarray(joints, float)
        return joints[..., self.carrying_joint, :, :] @ self.inverse_bind[self.carrying_joint]

    def head_place(self, joints: np.ndarray) -> np.ndarray:
        """Position (..., 3) [m] of the head's joint, as the hair is carried, for world joint transforms (..., J, 4, 4)."""
        if self.carrier is None:
            return joints[..., self.head, :3, 3]
        return self.canonical_to_world(joints)[..., :3, 3]

    def canonical_to_world(self, joints: np.ndarray) -> np.ndarray:
        """Transforms (..., 4, 4) from canonical to world space for world joint transforms (..., J, 4, 4)."""
        return self.carrying(joints) @ self.canonical_to_bind

    def skinning(self, joints: np.ndarray) -> np.ndarray:
        """Transforms (..., J, 4, 4) that take points from the bind pose, world, to canonical space as each joint moves them,
        for world joint transforms (..., J, 4, 4).
        """
        joints = np.asarray(joints, float)
        head = self.canonical_to_world(joints)
        to_canonical = inverse(head) if head.ndim == 2 else np.linalg.inv(head)[..., None, :, :]
        return to_canonical @ joints @ self.inverse_bind

    def relative_rotations(self, joints: np.ndarray, indices) -> np.ndarray:
        """World rotations (..., n, 3, 3) of the joints from the bind pose, in axes that face +Z there."""
        now = rotation_part(np.asarray(joints, float)[..., indices, :, :], "animation")
        asked = tuple(indices)
        if asked not in self._bind_turns:
            self._bind_turns[asked] = rotation_part(self.skeleton.bind[indices], "bind pose")
        return now @ np.swapaxes(self._bind_turns[asked], -1, -2) @ self.facing.T

    @cached_property
    def _bind_turns(self) -> dict[tuple, np.ndarray]:
        """Rotations (n, 3, 3) in the bind pose of the joints (n,) that were asked for: each frame asks for the same."""
        return {}

    def posed_body(self, joints: np.ndarray, shape: np.ndarray | None = None) -> np.ndarray | None:
        """World points (V, 3) of the body for one pose, joints (J, 4, 4)."""
        return None if self.body is None else self.body.posed(np.asarray(joints, float) @ self.inverse_bind, shape)

    @cached_property
    def heads(self) -> list[int]:
        """The head's joint, and copies of it in a control rig, from which its face and hair may hang."""
        return [self.head, *copies(self.head, self.skeleton.parents, self.skeleton.bind[:, :3, 3])]

    @cached_property
    def of_head(self) -> np.ndarray:
        """Which joints (J,) bool are one of the `heads` or below one."""
        return self.skeleton.below(*self.heads)

    @cached_property
    def on_head(self) -> np.ndarray | None:
        """Which body vertices (V,) move mainly with the head or a joint below it, including hats and hair cards."""
        if self.body is None:
            return None
        return self.body.weight_on(self.of_head) > 0.5

    @cached_property
    def on_head_joint(self) -> np.ndarray | None:
        """Which body vertices (V,) move mainly with the head's own joint."""
        if self.body is None:
            return None
        return self.body.weight_on(np.arange(len(self.skeleton.names)) == self.head) > 0.5

    @cached_property
    def skin(self) -> np.ndarray | None:
        """Which body vertices (V,) are the character's own, not what it wears; all if that is unknown."""
        if self.body is None:
            return None
        return own_skin(self.body.points, self.body.triangles, self.on_head, self.on_head_joint, HEAD_WIDTHS[0])

    @cached_property
    def head_skin(self) -> np.ndarray | None:
        """Which body vertices (V,) are the head's skin, on which it is measured; None if there are too few."""
        if self.body is None:
            return None
        mask = self.on_head & self.skin
        return mask if mask.sum() >= LEAST_SKIN else None

    @cached_property
    def body_shapes(self) -> np.ndarray:
        """Which blend shapes (B,) change the body, not the face: those that move nearly all of the head's skin, or more of the skin
        that does not follow the head than a jaw pulls at the neck.
        """
        if self.body is None or not self.body.shapes:
            return np.zeros(0, bool)
        head, rest = self.on_head & self.skin, ~self.on_head
        moved = [np.linalg.norm(offsets, axis=1) > MOVED for offsets in self.body.shapes.values()]
        return np.array([m[head].sum() > 0.8 * head.sum() or m[rest].sum() > 0.1 * rest.sum() for m in moved])

    @cached_property
    def head_width(self) -> float | None:
        """Width of the head's skin in bind pose [m], if there is a head with skin."""
        if "head" not in self.humanoid or self.head_skin is None:
            return None
        return float(np.ptp((self.body.points[self.head_skin] @ self.facing.T)[:, 0]))

    @cached_property
    def times_human(self) -> float:
        """How many times a person's size a giant is, a power of two; 1 if the head's width is believed, unknown or smaller."""
        if self.head_width is None or self.head_width <= HEAD_WIDTHS[1]:
            return 1.0
        return float(2 ** np.round(np.log2(self.head_width / COMMON_WIDTH)))

    @cached_property
    def head_centre(self) -> np.ndarray:
        """Centre of the head in canonical space (3,) [m]: middle of its surface, or an average adult's."""
        if self.head_skin is None:
            return np.array([0.0, 0.08, 0.02])
        points = (self.body.points[self.head_skin] - self.canonical_to_bind[:3, 3]) @ self.facing.T
        low, high = points.min(axis=0), points.max(axis=0)
        # Chin, neck and ears belong to the head's vertices but not to the skull: its width is measured above the ears, and limited
        # to its depth, since an elf's ears are higher.
        skull = points[points[:, 1] > high[1] / 2]
        width = np.ptp(skull[:, [0, 2]], axis=0).min() if high[1] > 0 and len(skull) else high[0] - low[0]
        return np.array([(low[0] + high[0]) / 2, high[1] - 0.65 * width, (low[2] + high[2]) / 2])
