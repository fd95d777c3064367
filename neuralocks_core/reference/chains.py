# SPDX-License-Identifier: Apache-2.0
"""Simulation of hair joint chains: the rods of `training/rig_energy.py` with inertia, many clips at once.

Implicit Euler in the head's frame, Gauss-Newton on the joints' rotations. Per unit of mass a step minimises

    sum m / (2 h^2) |x - y|^2 + sum m c / (2 h) |x - x_before|^2 + bend(D) - sum m (g + support) x + contact(x)

with x the bones' far ends in the head's frame now and y where free flight would have taken them. Bones meet the body as
spheres at their ends and middles, so that a clip needs no skin.
"""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.motion import GRAVITY
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rig.kinematics import bone_ends, pose_chains, quaternion_matrices
from neuralocks_core.rotation import quaternion_product


@dataclass(frozen=True)
class BodyPoints:
    """A few hundred body vertices around the head of each clip and step, in the head's frame.

    Attributes:
        points, normals: (C, T, P, 3) float32 [m].
        rest_points, rest_normals: of the bind pose, (P, 3).
    """

    points: np.ndarray
    normals: np.ndarray
    rest_points: np.ndarray
    rest_normals: np.ndarray


class ChainSolver:
    """One rig's chains under one material.

    Args:
        chains: the hair joints.
        tree: masses, stiffnesses and rest support (`training.rig_energy.RodTree`).
        damping: of motion in the head's frame [1/s].
        weight: times gravity.
        radius: of the spheres that meet the body [m]; less where they are nearer at rest.
    """

    STIFFNESS = 4e4
    """Of contact, per sphere and unit of its mass [1/s^2]: one g presses a sphere 0.25 mm deep."""

    def __init__(self, chains: HairChains, tree, damping: float, weight: float = 1.0, radius: float = 0.012):
        self.chains, self.tree, self.damping, self.weight, self.radius = chains, tree, damping, weight, radius
        count, bones = len(chains), len(chains.bones)
        # moves[m, j]: whether turning joint j moves the far end of bone m.
        self.moves = np.zeros((bones, count), bool)
        for bone, joint in enumerate(chains.bone_joint):
            while joint >= 0:
                self.moves[bone, joint] = True
                joint = chains.parents[joint]
        self.groups = [np.flatnonzero(chains.chain == c) for c in range(len(chains.roots))]
        self.group_bones = [np.flatnonzero(np.isin(chains.bone_joint, g)) for g in self.groups]

    def simulate(
        self, heads: np.ndarray, step: float, body: BodyPoints | None = None, *, substeps: int = 2, warm_up: int = 60
    ):
        """Turns (C, T, N, 4) wxyz, canonical, of the joints.

        Args:
            heads: canonical space to world, (C, T, 4, 4).
            step: time between samples [s].
            body: what the hair rests on.
            substeps: steps of integration a sample.
            warm_up: steps at the first pose before the motion begins, so that it begins at rest.
        """
        heads = np.asarray(heads, float)
        clips, samples = heads.shape[:2]
        h = step / substeps
        turns = np.zeros((clips, len(self.chains), 4))
        turns[..., 0] = 1
        limit = self._limits(body)
        result = np.empty((clips, samples, len(self.chains), 4), np.float32)
        before = last = None
        previous = heads[:, 0]
        for sample in range(samples):
            inner = warm_up + 1 if sample == 0 else substeps
            for part in range(inner):
                share = 1.0 if sample == 0 else (part + 1) / substeps
                head = _between(previous, heads[:, sample], share)
                rotation, origin = head[:, :3, :3], head[:, :3, 3]
                ends = bone_ends(self.chains, *pose_chains(self.chains, quaternion_matrices(turns)))
                if last is None:
                    last = before = np.einsum("cij,cmj->cmi", rotation, ends) + origin[:, None]
                if sample == 0:  # settles without momentum
                    before = last
                flight = np.einsum("cji,cmj->cmi", rotation, 2 * last - before - origin[:, None])
                gravity = np.einsum("cji,j->ci", rotation, GRAVITY * self.weight)
                near = None if body is None else (body.points[:, sample], body.normals[:, sample], limit)
                turns, ends = self._step(turns, ends, flight, gravity, h, near)
                before, last = last, np.einsum("cij,cmj->cmi", rotation, ends) + origin[:, None]
            previous = heads[:, sample]
            result[:, sample] = turns
        return result

    def _step(self, turns, start, flight, gravity, h, near, iterations: int = 2):
        chains, tree = self.chains, self.tree
        inertia, drag = 1 / h**2, self.damping / h
        for _ in range(iterations):
            matrices = quaternion_matrices(turns)
            rotations, positions = pose_chains(chains, matrices)
            ends = bone_ends(chains, rotations, positions)
            carriers = np.where((chains.parents < 0)[:, None, None], np.eye(3), rotations[:, chains.parents])
            force = (
                -tree.mass[:, None] * (inertia * (ends - flight) + drag * (ends - start) - gravity[:, None])
                + tree.support
            )
            stiff = np.broadcast_to((tree.mass * (inertia + drag))[:, None, None] * np.eye(3), (*ends.shape, 3)).copy()
            if near is not None:
                self._contact(ends, positions, near, force, stiff)
            w, v = turns[..., :1], turns[..., 1:]
            # d/dw of 2 k |v|^2 for a turn w applied from the left, in the carrier's axes.
            bend = -np.einsum("cnij,cnj->cni", carriers, 2 * tree.stiffness[:, None] * w * v)
            change = np.zeros_like(v)
            for joints, bones in zip(self.groups, self.group_bones):
                arm = ends[:, bones, None] - positions[:, None, joints]
                arm = arm * self.moves[bones][:, joints, None]
                cross = np.zeros((*arm.shape, 3))  # x moves by w x arm = -[arm] w
                cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = arm[..., 2], -arm[..., 1], arm[..., 0]
                cross -= np.swapaxes(cross, -1, -2)
                count = len(joints)
                jacobian = cross.transpose(0, 1, 3, 2, 4).reshape(len(turns), 3 * len(bones), 3 * count)
                weighted = stiff[:, bones] @ jacobian.reshape(len(turns), len(bones), 3, 3 * count)
                hessian = np.swapaxes(jacobian, 1, 2) @ weighted.reshape(jacobian.shape)
                index = np.arange(3 * count)
                hessian[:, index, index] += np.repeat(tree.stiffness[joints], 3) + 1e-9
                right = np.einsum("cab,ca->cb", jacobian, force[:, bones].reshape(len(turns), -1))
                right += bend[:, joints].reshape(len(turns), -1)
                solved = np.linalg.solve(hessian, right[..., None])[..., 0].reshape(len(turns), count, 3)
                change[:, joints] = solved
            size = np.linalg.norm(change, axis=-1, keepdims=True)
            change *= np.minimum(1, 0.6 / np.maximum(size, 1e-12))
            local = np.einsum("cnji,cnj->cni", carriers, change)
            turns = quaternion_product(_small(local), turns)
            turns = np.where(turns[..., :1] < 0, -turns, turns)
        return turns, bone_ends(chains, *pose_chains(chains, quaternion_matrices(turns)))

    def _limits(self, body):
        """Distance at which each end and middle touches: its radius, or its distance at rest if that is less."""
        if body is None:
            return None
        ends = self.chains.origins[self.chains.bone_joint] + self.chains.bones
        middles = ends - self.chains.bones / 2
        distance = _plane_distance(np.stack([ends, middles])[None], body.rest_points[None], body.rest_normals[None])[0][
            0
        ]
        return np.minimum(self.radius, distance)

    def _contact(self, ends, positions, near, force, stiff) -> None:
        points, normals, limit = near
        starts = positions[:, self.chains.bone_joint]
        spheres = np.stack([ends, (ends + starts) / 2], axis=1)
        distance, normal = _plane_distance(spheres, points, normals)
        depth = np.maximum(0, limit - distance)
        push = self.STIFFNESS * self.tree.mass
        for row, share in ((0, 1.0), (1, 0.5)):  # a middle is moved half by the end
            n = normal[:, row]
            force += share * (push * depth[:, row])[..., None] * n
            touching = (depth[:, row] > 0) * push * share * share
            stiff += touching[..., None, None] * n[..., :, None] * n[..., None, :]


def _plane_distance(spheres, points, normals):
    """Distance (C, R, M) to the plane of the nearest body vertex, and its normal; spheres (C, R, M, 3), points (C, P,
    3).
    """
    clips = len(spheres)
    flat = spheres.reshape(clips, -1, 3).astype(np.float32)
    square = np.einsum("cpi,cpi->cp", points, points)[:, None] - 2 * flat @ np.swapaxes(points, 1, 2).astype(np.float32)
    nearest = square.argmin(axis=-1)
    rows = np.arange(clips)[:, None]
    normal = normals[rows, nearest]
    distance = np.einsum("csi,csi->cs", flat - points[rows, nearest], normal)
    return distance.reshape(spheres.shape[:-1]).astype(float), normal.reshape(spheres.shape).astype(float)


def _between(a, b, share):
    """Rigid transforms (C, 4, 4) between a and b: positions linear, rotations the nearest to the blend of the matrices."""
    if share >= 1:
        return b
    result = (1 - share) * a + share * b
    u, _, vt = np.linalg.svd(result[:, :3, :3])
    result[:, :3, :3] = u @ vt
    return result


def _small(vector):
    """Quaternions of rotation vectors (..., 3) [rad]."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), vector * 0.5 * np.sinc(angle / (2 * np.pi))], axis=-1)
