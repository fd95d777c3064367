# SPDX-License-Identifier: Apache-2.0
"""A small humanoid for tests: six joints, hair, and motions whose answers are known."""

import numpy as np

from neuralocks_core.character import Character, Skeleton
from neuralocks_core.groom import Groom
from neuralocks_core.motion import Clip
from neuralocks_core.strands.strand_set import StrandSet, strand_set

NAMES = ("hips", "hips/spine", "hips/spine/neck", "hips/spine/neck/head", "hips/spine/arm_L", "hips/spine/arm_R")
PARENTS = (-1, 0, 1, 2, 1, 1)
POSITIONS = np.array([[0, 1.0, 0], [0, 1.2, 0], [0, 1.5, 0], [0, 1.6, 0], [0.2, 1.4, 0], [-0.2, 1.4, 0]], dtype=float)
HEAD = 3


def bind() -> np.ndarray:
    """(6, 4, 4) bind transforms."""
    transforms = np.tile(np.eye(4), (6, 1, 1))
    transforms[:, :3, 3] = POSITIONS
    return transforms


def person(turn: np.ndarray | None = None) -> Character:
    """The humanoid, as it is or turned as a whole by a rotation (3, 3)."""
    transforms = bind()
    if turn is not None:
        whole = np.eye(4)
        whole[:3, :3] = turn
        transforms = whole @ transforms
    return Character(Skeleton(NAMES, PARENTS, transforms))


def moved(times, offset=None, head_turn=None, loop=False) -> Clip:
    """A clip in which the whole body moves by offset(t) (T, 3) and the head turns by head_turn(t) (T, 3, 3)."""
    times = np.asarray(times, float)
    joints = np.tile(bind(), (len(times), 1, 1, 1))
    if offset is not None:
        joints[:, :, :3, 3] += offset(times)[:, None]
    if head_turn is not None:
        joints[:, HEAD, :3, :3] = head_turn(times)
    return Clip(times, joints, loop=loop)


def straight_hair(count=200, seed=0) -> StrandSet:
    """Strands that leave the upper half of the humanoid's head and hang."""
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=(count, 3))
    normal[:, 1] = np.abs(normal[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    s = np.linspace(0, 1, 24)
    points = normal[:, None] * (0.09 + 0.05 * s[:, None]) + (s**1.3)[:, None] * [0, -0.2, 0]
    points += bind()[HEAD, :3, 3]
    groom = Groom("hair", points.reshape(-1, 3).astype(np.float32), np.full(count, 24), np.full(1, 1e-4, np.float32))
    return strand_set(groom, bind()[HEAD, :3, 3], np.zeros(3))
