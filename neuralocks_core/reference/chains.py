# SPDX-License-Identifier: Apache-2.0
"""Simulation of hair joint chains: rods of the energy in `training/rig/energy.py`, with inertia, many clips at once.

Second backward differences, as in `solver`, and Gauss-Newton on the joints' rotations. Per unit of mass a step minimises

    9 sum m / (8 h^2) |x - y|^2 + 3 sum m c / (4 h) |x - z|^2 + bend(D) - sum m (g + support) x + contact(x)

with x the bones' far ends in the head's current frame, y where free flight would have taken them, and z where they would be if
they had the head's velocity. The contacts are points of the hair's mesh, each fixed to one joint, against the plane through the
nearest place of the body.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from neuralocks_core.motion import GRAVITY
from neuralocks_core.reference.chain_contact import BodyMesh, Contacts, NearestFaces
from neuralocks_core.reference.head_motion import between, head_motion
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.kinematics import bone_ends, pose_chains
from neuralocks_core.rig.rods import RodTree
from neuralocks_core.rotation import cross, from_quaternion, quaternion_product

ITERATIONS = 3
"""Gauss-Newton steps per time step. With two, hair that flies into the body is still up to 2 mm deep in it."""
SETTLE_DT, SETTLE_DAMPING = 1 / 60, 8.0
"""Steps [s] and damping [1/s] before the motion begins. In steps of 1/20 s, Gauss-Newton steps do not converge for soft hair, which
never comes to rest: ten bones of 3 cm with a bend of 1e-4 begin 14 to 18 cm from where they hang."""
AT_REST = 3e-6
"""Hair is at rest when no bone's end moves by more than this in a step [m], nor did in the step before."""


class ChainSolver:
    """One rig's chains under one material.

    Args:
        chains: the hair joints.
        tree: their masses, stiffnesses and rest support.
        damping: of motion in the head's frame [1/s].
        weight: factor on gravity.
        contacts: what collides with the body; ends and middles of the bones if left out.
    """

    STIFFNESS = 4e5
    """Contact stiffness per unit of the mass that a joint moves [1/s^2]: one g presses it in by 0.025 mm, on one of eight contacts by
    0.2 mm, of forty by 1 mm. With a tenth, a lock that is thrown against the neck lies 11 mm in it."""

    def __init__(
        self,
        chains: HairChains,
        tree: RodTree,
        damping: float,
        weight: float = 1.0,
        contacts: Contacts | None = None,
    ):
        self.chains, self.tree, self.damping, self.weight = chains, tree, damping, weight
        self.contacts = contacts or Contacts.of_bones(chains)
        count, owner = len(chains), self.contacts.joint
        carries = np.eye(count, dtype=bool)  # carries[i, j]: whether turning joint j turns joint i
        for joint, parent in enumerate(chains.parents):
            if parent >= 0:
                carries[joint] |= carries[parent]
        groups = [np.flatnonzero(chains.chain == c) for c in range(len(chains.roots))]
        self.alike = []
        for size in sorted({len(group) for group in groups}):
            joints = np.stack([group for group in groups if len(group) == size])
            self.alike.append(
                _Alike(joints, *_driven(chains.bone_joint, joints, carries), *_driven(owner, joints, carries))
            )
        mass = np.bincount(chains.bone_joint, tree.mass, count)
        self.contact_stiffness = (self.STIFFNESS * mass / np.maximum(np.bincount(owner, minlength=count), 1))[owner]

    def simulate(
        self,
        heads: np.ndarray,
        step: float,
        body: BodyMesh | None = None,
        wind: np.ndarray | None = None,
        *,
        substeps: int = 2,
        warm_up: int = 120,
    ):
        """Turns (C, T, N, 4) wxyz, canonical, of the joints.

        Args:
            heads: canonical space to world, (C, T, 4, 4).
            step: time between samples [s].
            body: the body to collide with.
            wind: acceleration of the hair at each sample, in world axes, (T, 3) [m/s^2]; it is linear between samples.
            substeps: integration steps per sample.
            warm_up: most steps of SETTLE_DT at the first pose before the motion begins, so that hair begins at rest relative to the
                head, which has moved at constant velocity without turning.
        """
        heads = np.asarray(heads, float)
        clips, samples = heads.shape[:2]
        turns = np.zeros((clips, len(self.chains), 4))
        turns[..., 0] = 1
        limit, near = self._limits(body), None if body is None else NearestFaces(body.samples)
        pull = GRAVITY * self.weight + (np.zeros((samples, 3)) if wind is None else wind)
        result = np.empty((clips, samples, len(self.chains), 4), np.float32)
        # by sample, then by clip
        bodies = None if body is None else np.swapaxes(body.vertices, 0, 1)
        ways = [head_motion(head, substeps) for head in heads]
        facing = np.stack([Rotation.from_quat(way.turn).as_matrix() for way in ways])
        places = np.stack([way.origin for way in ways])

        def advanced(turns, flown, at, h, damping):
            rotation, origin = facing[:, at], places[:, at]
            flight = np.einsum("cji,cmj->cmi", rotation, flown.free() - origin[:, None])
            gravity = np.einsum("cji,j->ci", rotation, between(pull, at, substeps))
            turns, ends = self._step(turns, flight, flown.carried(), gravity, h, damping, near, limit)
            return turns, flown.then(np.einsum("cij,cmj->cmi", rotation, ends) + origin[:, None], ends)

        def meet(at):
            if near is not None:
                near.move(between(bodies, at, substeps))

        ends = bone_ends(self.chains, *pose_chains(self.chains, from_quaternion(turns)))
        world = np.einsum("cij,cmj->cmi", facing[:, 0], ends) + places[:, 0, None]
        flown = _Flown.moving(world, ends, np.zeros((clips, 3)))
        meet(0)
        for _ in range(warm_up):
            turns, flown = advanced(turns, flown, 0, SETTLE_DT, SETTLE_DAMPING)
            if np.abs([flown.speed, flown.speed_before]).max() < AT_REST:
                break
        drift = places[:, min(1, places.shape[1] - 1)] - places[:, 0]
        flown = _Flown.moving(flown.last, flown.held, drift)
        result[:, 0] = turns
        for sample in range(1, samples):
            for at in range((sample - 1) * substeps + 1, sample * substeps + 1):
                meet(at)
                turns, flown = advanced(turns, flown, at, step / substeps, self.damping)
            result[:, sample] = turns
        return result

    def _step(self, turns, flight, carried, gravity, h, damping, near, limit):
        chains, tree = self.chains, self.tree
        inertia, drag = 9 / (4 * h**2), 3 * damping / (2 * h)
        planes = None
        for _ in range(ITERATIONS):
            matrices = from_quaternion(turns)
            rotations, positions = pose_chains(chains, matrices)
            ends = bone_ends(chains, rotations, positions)
            carriers = np.where((chains.parents < 0)[:, None, None], np.eye(3), rotations[:, chains.parents])
            force = (
                -tree.mass[:, None] * (inertia * (ends - flight) + drag * (ends - carried) - gravity[:, None])
                + tree.support
            )
            stiff = tree.mass * (inertia + drag)
            if near is not None:
                touching = self._touching(rotations, positions)
                if planes is None:
                    planes = near.planes(touching, limit + self._flown_by(ends, flight))
                depth = np.maximum(0, limit + planes[1] - np.einsum("cqi,cqi->cq", planes[0], touching))
            w, v = turns[..., :1], turns[..., 1:]
            # d/dw of 2 k |v|^2 for a turn w applied from the left, in the carrier's axes.
            bend = -np.einsum("cnij,cnj->cni", carriers, 2 * tree.stiffness[:, None] * w * v)
            change = np.zeros_like(v)
            for alike in self.alike:
                joints, bones, moves = alike.joints, alike.bones, alike.moves
                arm = (ends[:, bones, None] - positions[:, joints][:, :, None]) * moves[..., None]
                lever = np.zeros((*arm.shape, 3))  # x moves by w x arm = -[arm] w
                lever[..., 0, 1], lever[..., 0, 2], lever[..., 1, 2] = arm[..., 2], -arm[..., 1], arm[..., 0]
                lever -= np.swapaxes(lever, -1, -2)
                shape = (len(turns), len(joints), 3 * bones.shape[1], 3 * joints.shape[1])
                jacobian = lever.transpose(0, 1, 2, 4, 3, 5).reshape(shape)
                across = np.swapaxes(jacobian, 2, 3)
                hessian = across @ (np.repeat(stiff[bones], 3, axis=1)[..., None] * jacobian)
                index = np.arange(shape[-1])
                hessian[..., index, index] += np.repeat(tree.stiffness[joints], 3, axis=1) + 1e-9
                right = across @ force[:, bones].reshape(*shape[:3], 1)
                right += bend[:, joints].reshape(*right.shape)
                if near is not None:
                    contacts, moves = alike.touching(depth)
                    arm = (touching[:, contacts, None] - positions[:, joints][:, :, None]) * moves[..., None]
                    away = cross(arm, planes[0][:, contacts, None]).reshape(*shape[:2], contacts.shape[1], shape[3])
                    push = (self.contact_stiffness[contacts] * (depth[:, contacts] > 0))[..., None]
                    across = np.swapaxes(away * push, 2, 3)
                    hessian += across @ away
                    right += across @ depth[:, contacts, None]
                change[:, joints] = np.linalg.solve(hessian, right).reshape(*shape[:2], -1, 3)
            size = np.linalg.norm(change, axis=-1, keepdims=True)
            change *= np.minimum(1, 0.6 / np.maximum(size, 1e-12))
            local = np.einsum("cnji,cnj->cni", carriers, change)
            turns = quaternion_product(_small(local), turns)
            turns = np.where(turns[..., :1] < 0, -turns, turns)
        return turns, bone_ends(chains, *pose_chains(chains, from_quaternion(turns)))

    def _limits(self, body):
        """Distance that each contact keeps: its radius, or its distance at rest if that is less."""
        if body is None:
            return None
        still = NearestFaces(body.samples)
        still.move(body.rest[None])
        normals, offsets = still.planes(self.contacts.points[None])
        return np.minimum(self.contacts.radius, np.einsum("qi,qi->q", normals[0], self.contacts.points) - offsets[0])

    def _flown_by(self, ends, flight):
        """How far the fastest bone of each contact's chain would fly in a step, (C, Q) [m], from ends (C, M, 3)."""
        farthest = np.zeros((len(self.chains.roots), len(ends)))
        np.maximum.at(farthest, self.chains.chain[self.chains.bone_joint], np.linalg.norm(flight - ends, axis=2).T)
        return farthest[self.chains.chain[self.contacts.joint]].T

    def _touching(self, rotations, positions):
        """Where the contacts are, (C, Q, 3)."""
        owner = self.contacts.joint
        arm = self.contacts.points - self.chains.origins[owner]
        return positions[:, owner] + np.einsum("cqij,qj->cqi", rotations[:, owner], arm)


@dataclass(frozen=True)
class _Alike:
    """G chains of as many joints, which are solved together: calls, not arithmetic, take most of the time of a small one.

    Attributes:
        joints: (G, n).
        bones: that they move, (G, m); those of shorter chains are repeated.
        moves: which bone is moved by which joint, (G, m, n); a repeated one by none.
        contacts, contact_moves: the same for contacts.
    """

    joints: np.ndarray
    bones: np.ndarray
    moves: np.ndarray
    contacts: np.ndarray
    contact_moves: np.ndarray

    def touching(self, depth):
        """`contacts` and `contact_moves` of those with a depth (C, Q) in some clip, with as many others as make rows equal."""
        touched = (depth[:, self.contacts] > 0).any(axis=0)
        first = np.argsort(~touched, axis=1, kind="stable")[:, : touched.sum(axis=1).max()]
        return np.take_along_axis(self.contacts, first, 1), np.take_along_axis(self.contact_moves, first[..., None], 1)


def _driven(owner, joints, carries):
    """What the joints of some chains (G, n) move, of things fixed to joints `owner` (K,): their indices (G, k), and which of them are
    moved by which joint (G, k, n). Rows end with things that none moves.
    """
    mine = [np.flatnonzero(np.isin(owner, group)) for group in joints]
    indices = np.zeros((len(joints), max(map(len, mine))), int)
    moves = np.zeros((*indices.shape, joints.shape[1]), bool)
    for row, (own, group) in enumerate(zip(mine, joints)):
        indices[row, : len(own)] = own
        moves[row, : len(own)] = carries[owner[own]][:, group]
    return indices, moves


@dataclass(frozen=True)
class _Flown:
    """The last two states of the bones' ends (C, M, 3): in the world, in the head's frame, and their velocities [m per step].
    Velocities and accelerations are second backward differences, as in `stepper`.
    """

    last: np.ndarray
    before: np.ndarray
    held: np.ndarray
    held_before: np.ndarray
    speed: np.ndarray
    speed_before: np.ndarray

    @classmethod
    def moving(cls, world, held, drift):
        """With the velocities (C, 3) [m per step] of heads that do not turn, at rest relative to them."""
        drift = np.broadcast_to(drift[:, None], world.shape)
        return cls(world, world - drift, held, held, drift, drift)

    def free(self):
        """Where the ends would be after a step without forces, in the world."""
        return (12 * self.last - 3 * self.before + 2 * (4 * self.speed - self.speed_before)) / 9

    def carried(self):
        """Where they would be in the head's frame if their velocity was the head's."""
        return (4 * self.held - self.held_before) / 3

    def then(self, world, held):
        """A step later."""
        speed = (3 * world - 4 * self.last + self.before) / 2
        return _Flown(world, self.last, held, self.held, speed, self.speed)


def _small(vector):
    """Quaternions of rotation vectors (..., 3) [rad]."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), vector * 0.5 * np.sinc(angle / (2 * np.pi))], axis=-1)
