# SPDX-License-Identifier: Apache-2.0
"""VRM spring bones, as specified (VRM 1.0 VRMC_springBone): the usual way to move avatars' hair.

    next = tail + (tail - previous tail) (1 - drag) + parent rotation * rest axis * stiffness dt
        + gravity direction * gravity power dt

then back to the bone's length, and the joint turns from its rest axis to the new one. State is carried from frame to
frame, and drag acts per frame, whatever its length: that is the specified behaviour.
"""

from dataclasses import dataclass

import numpy as np

from neuralocks_core.character import levels
from neuralocks_core.rig.chains import HairChains
from neuralocks_core.rotation import from_quaternion, quaternion_between


@dataclass(frozen=True)
class SpringSettings:
    """The specified parameters; their defaults are those of UniVRM and three-vrm, where the schema's drag is 0.5.

    Attributes:
        stiffness: pull to the rest direction [m/s].
        drag: share of the tail's motion that is lost each frame.
        gravity_power: pull downwards [m/s].
    """

    stiffness: float | np.ndarray = 1.0
    drag: float | np.ndarray = 0.4
    gravity_power: float | np.ndarray = 0.0


def spring_bones(
    chains: HairChains, heads: np.ndarray, step: float, settings: SpringSettings = SpringSettings()
) -> np.ndarray:
    """Turns (C, T, N, 4) wxyz, canonical, of joints that swing like spring bones.

    Args:
        chains: the hair joints.
        heads: canonical space to world, (C, T, 4, 4).
        step: time between frames [s].
        settings: as the artist sets them; arrays (C,) give each clip its own.
    """
    heads = np.asarray(heads, float)
    clips, frames = heads.shape[:2]
    stiffness, drag, gravity = (
        np.reshape(value, (-1, 1, 1)) for value in (settings.stiffness, settings.drag, settings.gravity_power)
    )
    first = np.array([np.flatnonzero(chains.bone_joint == j)[0] for j in range(len(chains))])
    bones, lengths = chains.bones[first], chains.lengths[first][:, None]
    rest_tail = chains.origins + bones
    tail = np.einsum("cij,nj->cni", heads[:, 0, :3, :3], rest_tail) + heads[:, 0, None, :3, 3]
    previous = tail.copy()
    result = np.empty((clips, frames, len(chains), 4), np.float32)
    # The head stands before the joints, as the parent of those that have none.
    world, place = np.empty((clips, len(chains) + 1, 3, 3)), np.empty((clips, len(chains) + 1, 3))
    by_level = [(joints, chains.parents[joints] + 1) for joints in levels(chains.parents)]
    for frame in range(frames):
        world[:, 0], place[:, 0] = heads[:, frame, :3, :3], heads[:, frame, :3, 3]
        for joints, parent in by_level:
            carrier = world[:, parent]
            origin = place[:, joints + 1] = place[:, parent] + _turned(carrier, chains.ways[joints])
            axis = _turned(carrier, bones[joints] / lengths[joints])
            now = tail[:, joints]
            new = now + (now - previous[:, joints]) * (1 - drag) + axis * stiffness * step
            new = _at_length(origin, new + np.array([0.0, -1.0, 0.0]) * gravity * step, lengths[joints])
            previous[:, joints], tail[:, joints] = now, new
            local = np.einsum("cnji,cnj->cni", carrier, new - origin)
            turn = quaternion_between(bones[joints], local)
            result[:, frame, joints] = turn = turn / np.linalg.norm(turn, axis=-1, keepdims=True)
            world[:, joints + 1] = carrier @ from_quaternion(turn)
    return result


def _turned(rotations: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("cnij,nj->cni", rotations, vectors)


def _at_length(origin, point, length):
    way = point - origin
    return origin + way * (length / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9))
