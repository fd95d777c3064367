# SPDX-License-Identifier: Apache-2.0
"""Cuts in a clip: a character jumps to another place between two samples, and its hair must not feel the jump."""

import numpy as np

from neuralocks_core.boundary.stepped import Stepped
from neuralocks_core.motion import Clip

JUMP = 0.4
"""A step is a cut if it ends farther [m] than this from where the motion before it, and the motion after it, would have
put the joint: in 1/24 s, that takes 23 g."""
_TURN = np.radians(72.0)
"""The same for the joint's rotation [rad]."""
LONGEST = 0.1
"""Longer steps [s] are not cuts: in that time people can get anywhere."""
APART = 0.2
"""Steps closer together than this [s] are not cuts, but motion too fast for its rate, or stepped animation."""


def find_cuts(clip: Clip, joint: int) -> np.ndarray:
    """Times (C,) [s] of the first sample after each cut, judged by one joint of a clip, the head, whether it loops or not.

    A step is a cut if neither the motion before nor the motion after it explains it. Several in a row are not cuts, but damaged
    samples, or motion too fast for its rate.
    """
    jumps, alone = _jumps(clip, joint)
    return jumps[alone]


def find_flashes(clip: Clip, joint: int) -> np.ndarray:
    """Times (C,) [s] of the first sample after each step that would be a cut, but has another one within `APART`: the hair is
    flung there. Empty for animation that holds its poses, since hair does not feel its steps.
    """
    jumps, alone = _jumps(clip, joint)
    return jumps[~alone] if len(jumps) and not len(Stepped.of(clip, [joint]).held) else np.zeros(0)


def _jumps(clip: Clip, joint: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (C,) [s] of the first sample after each step that the motion around it does not explain, and which of them have no
    other one near, (C,) bool.
    """
    times = clip.times
    if len(times) < 3:
        return np.zeros(0), np.zeros(0, bool)
    places, turns = clip.joints[:, joint, :3, 3], clip.joints[:, joint, :3, :3]
    span = np.diff(times)
    speed = np.diff(places, axis=0) / span[:, None]
    # If a joint has zero scale, which a bake refuses, its turn is not judged.
    size = np.maximum(np.einsum("tij,tij->t", turns[:-1], turns[:-1]), 1e-30)
    spin = np.einsum("tij,tij->t", turns[1:], turns[:-1]) / size
    angle = np.arccos(np.clip((3 * spin - 1) / 2, -1, 1))
    # Before its first sample and after its last one a clip stands still.
    unlike = np.tile(np.linalg.norm(np.diff(places, axis=0), axis=1), (2, 1))
    gap = np.linalg.norm(np.diff(speed, axis=0), axis=1)
    unlike[0, 1:], unlike[1, :-1] = gap * span[1:], gap * span[:-1]
    fling = np.tile(angle, (2, 1))
    fling[0, 1:] = angle[1:] - angle[:-1] * span[1:] / span[:-1]
    fling[1, :-1] = angle[:-1] - angle[1:] * span[:-1] / span[1:]
    jumped = ((unlike.min(axis=0) > JUMP) | (fling.min(axis=0) > _TURN)) & (span < LONGEST)
    found = np.flatnonzero(jumped)
    crowded = np.diff(times[1:][found]) < APART
    alone = np.ones(len(found), bool)
    alone[1:] &= ~crowded
    alone[:-1] &= ~crowded
    return times[1:][found], alone
