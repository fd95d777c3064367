# SPDX-License-Identifier: Apache-2.0
"""Posing hair chains and their skin in the head's frame, for many poses at once.

A joint's turn D is measured from its bind pose relative to its carrier, in canonical axes: G_j = G_parent D_j,
with G = 1 for the head. In the joint's own bind axes B it is B^T D B, by which an animation system
multiplies the joint's local bind rotation from the right.
"""

import numpy as np

from neuralocks_core.character import levels
from neuralocks_core.rig.chains import HairChains


def half_turns(raw: np.ndarray, max_angle: float) -> np.ndarray:
    """Quaternions (..., 4) wxyz from any finite vectors (..., 3): vector part raw * s / sqrt(1 + |raw|^2), s =
    sin(max_angle / 2).

    Smooth and without singularity, zero for zero, and bounded by `max_angle` [rad] for any input; needs only square
    roots, so it costs almost nothing in C. A rotation vector limited by a tanh would need a sine and a tanh per joint.
    """
    vector = raw * (np.sin(max_angle / 2) / np.sqrt(1 + np.sum(raw * raw, axis=-1, keepdims=True)))
    scalar = np.sqrt(np.maximum(1 - np.sum(vector * vector, axis=-1, keepdims=True), 0))
    return np.concatenate([scalar, vector], axis=-1)


def pose_chains(chains: HairChains, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turns (B, N, 3, 3) in canonical axes -> rotations G (B, N, 3, 3) from the bind pose and joint positions (B, N, 3) [m]."""
    rotations = np.empty_like(turns)
    positions = np.empty(turns.shape[:2] + (3,), turns.dtype)
    for level in levels(chains.parents):
        up = chains.parents[level]
        if up[0] < 0:
            rotations[:, level], positions[:, level] = turns[:, level], chains.origins[level]
            continue
        rotations[:, level] = rotations[:, up] @ turns[:, level]
        way = chains.origins[level] - chains.origins[up]
        positions[:, level] = positions[:, up] + np.einsum("bnij,nj->bni", rotations[:, up], way)
    return rotations, positions


def bone_ends(chains: HairChains, rotations: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Far ends (B, M, 3) [m] of the bones."""
    joint = chains.bone_joint
    return positions[:, joint] + np.einsum("bmij,mj->bmi", rotations[:, joint], chains.bones)


def skin_weights(
    chains: HairChains, joint_count: int, parents: np.ndarray, indices: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Weights (V, 1 + N) on the head and the moving joints, from a mesh's own indices and weights (V, I).

    An end joint counts as the moving joint above it; whatever else drives a vertex counts as the head.
    """
    slot = np.zeros(joint_count, int)
    slot[chains.joints] = np.arange(len(chains)) + 1
    for joint in range(joint_count):
        if not slot[joint] and parents[joint] >= 0:
            slot[joint] = slot[parents[joint]]
    dense = np.zeros((len(indices), len(chains) + 1))
    np.add.at(dense, (np.arange(len(indices))[:, None], slot[indices]), weights)
    return dense


def skin(
    chains: HairChains, rotations: np.ndarray, positions: np.ndarray, points: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Linear blend skinning of canonical points (V, 3) with weights (V, 1 + N): (B, V, 3) [m]."""
    shift = positions - np.einsum("bnij,nj->bni", rotations, chains.origins)
    count = len(rotations)
    transforms = np.concatenate([rotations, shift[..., None]], axis=-1).reshape(count, len(chains), 12)
    rest = np.eye(3, 4).reshape(1, 1, 12).repeat(count, axis=0)
    blended = (weights @ np.concatenate([rest, transforms], axis=1)).reshape(count, -1, 3, 4)
    return np.einsum("bvij,vj->bvi", blended[..., :3], points) + blended[..., 3]
