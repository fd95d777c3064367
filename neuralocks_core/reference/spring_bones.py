# SPDX-License-Identifier: Apache-2.0
"""VRM spring bones, as specified (VRM 1.0 VRMC_springBone): the usual way to move avatars' hair.

    next = tail + (tail - previous tail) (1 - drag) + parent rotation * rest axis * stiffness dt
        + gravity direction * gravity power dt

then back to the bone's length, and the joint turns from its rest axis to the new one. State is carried from frame to
frame, and drag acts per frame, whatever its length: that is the specified behaviour.
"""

from dataclasses import dataclass

import numpy as np

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

    stiffness: float = 1.0
    drag: float = 0.4
    gravity_power: float = 0.0


def spring_bones(
    chains: HairChains, heads: np.ndarray, step: float, settings: SpringSettings = SpringSettings()
) -> np.ndarray:
    """Turns (C, T, N, 4) wxyz, canonical, of joints that swing like spring bones.

    Args:
        chains: the hair joints.
        heads: canonical space to world, (C, T, 4, 4).
        step: time between frames [s].
        settings: as the artist sets them.
    """
    heads = np.asarray(heads, float)
    clips, frames = heads.shape[:2]
    first = np.array([np.flatnonzero(chains.bone_joint == j)[0] for j in range(len(chains))])
    bones, lengths = chains.bones[first], chains.lengths[first]
    way = chains.ways
    rest_tail = chains.origins + bones
    tail = np.einsum("cij,nj->cni", heads[:, 0, :3, :3], rest_tail) + heads[:, 0, None, :3, 3]
    previous = tail.copy()
    result = np.empty((clips, frames, len(chains), 4), np.float32)
    for frame in range(frames):
        rotation, origin = heads[:, frame, :3, :3], heads[:, frame, :3, 3]
        world = np.empty((clips, len(chains), 3, 3))
        place = np.empty((clips, len(chains), 3))
        for j, parent in enumerate(chains.parents):
            carrier = rotation if parent < 0 else world[:, parent]
            place[:, j] = (origin if parent < 0 else place[:, parent]) + carrier @ way[j]
            axis = carrier @ (bones[j] / lengths[j])
            new = tail[:, j] + (tail[:, j] - previous[:, j]) * (1 - settings.drag)
            new = new + axis * settings.stiffness * step + np.array([0.0, -1.0, 0.0]) * settings.gravity_power * step
            new = _at_length(place[:, j], new, lengths[j])
            previous[:, j], tail[:, j] = tail[:, j], new
            local = np.einsum("cji,cj->ci", carrier, new - place[:, j]) / lengths[j]
            turn = quaternion_between(bones[j], local)
            result[:, frame, j] = turn = turn / np.linalg.norm(turn, axis=-1, keepdims=True)
            world[:, j] = carrier @ from_quaternion(turn)
    return result


def _at_length(origin, point, length):
    way = point - origin
    return origin + way * (length / np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9))
