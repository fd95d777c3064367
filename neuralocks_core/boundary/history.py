# SPDX-License-Identifier: Apache-2.0
"""The boundary history: what the body did up to a time, as the vector that a network reads (paper section 3.3).

The paper gives body pose, shape coefficients and N = 30 earlier joint velocities. Here the pose is relative to the head
and the bind pose, so that joint orients and names cancel out; the shape is measured on the body, so that it means the
same on every rig; and the history holds effective gravity in the head's frame, R^T (g - a), without which a jump cannot
be seen. `docs/deviations.md` says why.
"""

import math
from numbers import Real

import numpy as np

from neuralocks_core import rotation
from neuralocks_core.arguments import number_array
from neuralocks_core.boundary.spec import MATERIALS, POSE_JOINTS, BoundarySpec
from neuralocks_core.boundary.stepped import Stepped
from neuralocks_core.boundary.sudden_stops import softened
from neuralocks_core.boundary.track import Track
from neuralocks_core.character import Character
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.materials import UNREAD, at_weight_one
from neuralocks_core.measures import measures_read
from neuralocks_core.motion import GRAVITY, Clip, G, time_array
from neuralocks_core.wind import Wind, check_felt


def joints_read(character: Character, pose_joints=POSE_JOINTS) -> list[int]:
    """The joint that carries the hair, the upper chest and the pose joints, or the rig's substitutes for them."""
    others = ("upper_chest", *pose_joints)
    return [character.carrying_joint, *(character.humanoid.nearest(name) for name in others)]


class BoundarySampler:
    """Boundary vectors of one character in one clip, at any time.

    Motion between samples, and before and after the clip, is that of `Track`; of animation on twos, that of `Stepped`. After a
    cut, that part of the clip is read by itself.

    Attributes:
        joints: joint indices of the head, the upper chest and the pose joints (n + 2,).
        stance: rotation from a T-pose to each pose joint's own bind pose, (n, 3, 3).
    """

    GRAVITY_LIMIT = 6.0
    """Largest change of effective gravity that is passed on [g]: a teleport must not take the network out of its training range."""
    SPIN_LIMIT = 25.0
    """Largest angular velocity that is passed on [rad/s]."""
    SPEED_LIMIT = 25.0
    """Largest velocity of the head that is passed on [m/s]."""

    def __init__(self, spec: BoundarySpec, character: Character, clip: Clip):
        self.spec, self.character, self.clip = spec, character, clip
        self.joints = joints_read(character, spec.pose_joints)
        self.stance = np.stack([_stance(character, name) for name in spec.pose_joints])
        parts = clip.parts if spec.bins else [clip]
        self._cuts = np.array([part.start for part in parts[1:]])
        self._stepped = [Stepped.of(part, self.joints) for part in parts]
        felt = [self._felt(each.clip) for each in self._stepped]
        self._tracks = [Track(character, each, self.joints) for each in felt]
        self._bin_weights = spec.bin_weights
        self._shape_cache: dict[bytes, np.ndarray] = {}

    def _felt(self, clip: Clip) -> Clip:
        """A part of the clip with its blows limited to what is passed on."""
        if self.spec.linear != "gravity":
            return clip
        return softened(clip, self.character, self.GRAVITY_LIMIT, self.spec.dt)

    def vectors(
        self,
        times,
        material=(0.0,) * MATERIALS,
        strength: float = 1.0,
        joints: np.ndarray | None = None,
        wind: Wind | None = None,
    ) -> np.ndarray:
        """Boundary vectors (n, spec.size) float32 at times (n,) [s].

        Args:
            times: (n,) [s].
            material: log-ratios to the reference material, (4,) or (n, 4). Vectors are for hair of weight 1 (`at_weight_one`),
                with the motion at its speed; they hold `UNREAD` constants as given.
            strength: motion strength; scales the history and is exact at 0 (the held pose).
            joints: the world joint transforms (n, J, 4, 4) that are drawn at these times, if they are known
                better than from the clip.
            wind: added to the history, whatever the strength: hair feels a wind w as it feels the head accelerate by -w.

        Raises:
            NeuralocksError: a time, material or strength is not a finite number, the strength is below 0, an array has the wrong
                shape, or there is a wind that this spec has no place for.
        """
        spec, times = self.spec, time_array(times)
        if not np.isfinite(times).all():
            raise NeuralocksError("times: hold NaN or infinity; give seconds")
        if not (isinstance(strength, Real) and 0 <= strength < math.inf):
            raise NeuralocksError(f"strength {strength}: give a number of at least 0, 0 for the held pose")
        if joints is not None:
            wanted = len(times), len(self.character.skeleton.names), 4, 4
            joints = number_array("joints", joints, f"{wanted}")
            if joints.shape != wanted:
                raise NeuralocksError(f"joints: are of shape {joints.shape}; give {wanted}")
        if not len(times):
            return np.zeros((0, spec.size), np.float32)
        ratios, pace = _read(material, len(times))
        lags = spec.dt * np.arange(spec.steps + 2) / pace[:, None]
        position, turns, shown = self._sample(times, lags)
        now = turns[:, 0] if joints is None else self.character.relative_rotations(joints, self.joints)
        result = np.zeros((len(times), spec.size), np.float32)
        parts = spec.slices
        head = now[:, 0]
        relative = np.swapaxes(head[:, None], -1, -2) @ now[:, 2:] @ self.stance
        result[:, parts["pose"]] = relative[..., :2].swapaxes(-1, -2).reshape(len(times), -1)
        static = np.einsum("nji,j->ni", head, GRAVITY / G)
        result[:, parts["gravity"]] = static
        result[:, parts["shape"]] = [self._measures(shape) for shape in self.clip.shape_at(times)]
        result[:, parts["material"]] = ratios
        if spec.bins:
            result[:, parts["history"]] = strength * self._history(position, turns, static)
        if wind is not None:
            result[:, parts["history"]] += self._blown(wind, turns, shown[:, None] - lags) / pace[:, None] ** 2
        return result

    def held_bind(self, material=(0.0,) * MATERIALS, shape: np.ndarray | None = None) -> np.ndarray:
        """The vector (spec.size,) of the bind pose held still: the reference for an anchored network's output.

        Args:
            material: as for `vectors`, (4,).
            shape: blend shape weights (B,), as the clip has them; those of its first sample if left out.

        Raises:
            NeuralocksError: material or shape are not finite numbers, or not as many.
        """
        result = np.zeros(self.spec.size, np.float32)
        parts = self.spec.slices
        result[parts["pose"]] = self.stance[..., :2].swapaxes(-1, -2).ravel()
        result[parts["gravity"]] = GRAVITY / G
        first = self.clip.shape[0]
        wanted = f"{first.shape} blend shape weights"
        shape = first if shape is None else number_array("shape", shape, wanted)
        if shape.shape != first.shape or not np.isfinite(shape).all():
            raise NeuralocksError(f"shape {shape}: give {wanted}, as the clip has, of finite numbers")
        result[parts["shape"]] = self._measures(shape)
        result[parts["material"]] = _read(material)[0]
        return result

    def _measures(self, shape: np.ndarray) -> np.ndarray:
        key = shape.tobytes()
        if key not in self._shape_cache:
            if len(self._shape_cache) > 64:
                self._shape_cache.clear()
            self._shape_cache[key] = measures_read(self.character, shape)
        return self._shape_cache[key]

    def _sample(self, times: np.ndarray, lags: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Head positions (n, L, 3) and rotations (n, L, joints, 3, 3) at times (n,) minus lags (n, L), as if there had been nothing
        before the last cut; and the times (n,) whose motion is shown, which differ in animation on twos.
        """
        position = np.empty((*lags.shape, 3))
        turns = np.empty((*lags.shape, len(self.joints), 3, 3))
        shown = np.empty(len(times))
        part = np.searchsorted(self._cuts - 1e-9, times, side="right")
        for one in np.unique(part):
            rows = part == one
            shown[rows] = self._stepped[one].times(times[rows])
            places, rotations = self._tracks[one].at((shown[rows, None] - lags[rows]).ravel())
            position[rows] = places.reshape(-1, *position.shape[1:])
            turns[rows] = rotations.reshape(-1, *turns.shape[1:])
        return position, turns, shown

    def _history(self, position, turns, static) -> np.ndarray:
        """(n, per_bin * bins): means over the bins, newest first, tapered."""
        spec = self.spec
        to_head = np.swapaxes(turns[:, :-2, 0], -1, -2)
        columns = []
        if spec.linear == "gravity":
            acceleration = (position[:, :-2] - 2 * position[:, 1:-1] + position[:, 2:]) / spec.dt**2
            felt = np.einsum("nkij,nkj->nki", to_head, GRAVITY - acceleration) / G
            columns.append(_limited(felt - static[:, None], self.GRAVITY_LIMIT))
        elif spec.linear == "velocity":
            velocity = (position[:, :-2] - position[:, 1:-1]) / spec.dt
            columns.append(_limited(np.einsum("nkij,nkj->nki", to_head, velocity), self.SPEED_LIMIT))
        both = slice(1 + spec.chest)  # head and upper chest
        spins = rotation.to_vector(turns[:, :-2, both] @ np.swapaxes(turns[:, 1:-1, both], -1, -2)) / spec.dt
        for spin in np.moveaxis(spins, 2, 0):
            columns.append(_limited(np.einsum("nkij,nkj->nki", to_head, spin), self.SPIN_LIMIT))
        return self._binned(np.concatenate(columns, axis=-1))

    def _blown(self, wind: Wind, turns: np.ndarray, times: np.ndarray) -> np.ndarray:
        """What a wind adds to `_history`, with the head's rotations at times (n, L)."""
        if not isinstance(wind, Wind):
            raise NeuralocksError(f"wind {wind!r}: is not a wind; give a neuralocks_core.wind.Wind")
        check_felt(self.spec.feels_wind)
        push = wind.at(times[:, :-2], self.clip.period) / G
        rows = np.zeros((*push.shape[:2], self.spec.per_bin))
        rows[..., :3] = np.einsum("nkji,nkj->nki", turns[:, :-2, 0], push)
        return self._binned(rows)

    def _binned(self, rows: np.ndarray) -> np.ndarray:
        """Means (n, bins * per_bin) of values (n, steps, per_bin) over each bin, newest first, tapered."""
        ends = np.cumsum(self.spec.bins)
        means = np.add.reduceat(rows, np.concatenate([[0], ends[:-1]]), axis=1) / np.asarray(self.spec.bins)[:, None]
        return (means * self._bin_weights[:, None]).reshape(len(rows), -1)


def _stance(character: Character, name: str) -> np.ndarray:
    """Rotation (3, 3) from a T-pose's upper arm to the rig's own bind pose; identity for other joints.

    Without it the same hanging arm would read differently on a rig bound in T-pose and on one bound in A-pose.
    """
    side = name.removesuffix("_upper_arm")
    arm, elbow = character.humanoid.get(name), character.humanoid.get(f"{side}_lower_arm")
    if side == name or arm is None or elbow is None:
        return np.eye(3)
    bone = character.facing @ (character.skeleton.bind[elbow, :3, 3] - character.skeleton.bind[arm, :3, 3])
    if np.linalg.norm(bone) < 1e-6:
        return np.eye(3)
    return rotation.between([1.0 if side == "left" else -1.0, 0.0, 0.0], bone)


def _read(material, *count: int) -> tuple[np.ndarray, np.ndarray]:
    """What vectors hold of a material, (4,) or (n, 4) for a `count`, and the motion's speed in them, () or (n,)."""
    material = number_array("material", material, f"({MATERIALS},) log-ratios, as Material.log_ratios does")
    if material.shape not in ((MATERIALS,), (*count, MATERIALS)) or not np.isfinite(material).all():
        raise NeuralocksError(f"material {material}: give {MATERIALS} log-ratios, as Material.log_ratios does")
    given = np.broadcast_to(material, (*count, MATERIALS))
    ratios, pace = at_weight_one(given)
    ratios[..., UNREAD] = given[..., UNREAD]
    return ratios, pace


def _limited(vectors: np.ndarray, limit: float) -> np.ndarray:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors * np.minimum(1.0, limit / np.maximum(length, 1e-9))
