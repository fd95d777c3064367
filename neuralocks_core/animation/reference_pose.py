# SPDX-License-Identifier: Apache-2.0
"""A reference pose before a performance: the first sample shows the bind pose, the next one is in the middle of a motion. Files
from FBX often begin like that, and hair must not feel the way between.
"""

import numpy as np

from neuralocks_core.animation.cuts import LONGEST
from neuralocks_core.boundary.history import joints_read
from neuralocks_core.boundary.stepped import Stepped
from neuralocks_core.character import Character
from neuralocks_core.motion import Clip
from neuralocks_core.rotation import angle_between, flat, rotation_part, volumes

SAME = np.radians(1.0)
"""A body whose joints are all turned by less than this [rad] from a pose shows that pose."""
FAR = np.radians(15.0)
"""A step that turns a joint farther than the next step by this [rad] is not the beginning of a motion, which gets faster."""
FELT, FELT_SHIFT = np.radians(3.0), 0.005
"""Likewise, head or chest must turn by this [rad], or the head go as far as this [m]: hair feels no more of a body."""
HELD = 1.0
"""A pose that is held for longer [s] is no reference."""


def reference_end(clip: Clip, character: Character, poses: list[np.ndarray]) -> float | None:
    """Time [s] of the first sample after a reference pose at a clip's beginning; None if it begins with none, or with a motion
    from there.

    Args:
        clip: the motion; not a loop.
        character: that it moves.
        poses: world transforms (J, 4, 4) of the poses that may be a reference, such as the bind pose.
    """
    if len(clip.times) < 3 or "head" not in character.humanoid:
        return None
    near = clip.joints[: np.searchsorted(clip.times, clip.start + HELD) + 2]
    for pose in poses:
        # Most clips begin otherwise, and no more of them is looked at.
        body = _readable_body(character, np.stack([pose, near[0]]))
        wanted = _turns(character, body, pose)
        if not len(body) or angle_between(_turns(character, body, near[0]), wanted).max() > SAME:
            continue
        body = _readable_body(character, np.concatenate([pose[None], near]))
        wanted = _turns(character, body, pose)
        turned = angle_between(_turns(character, body, near), wanted).max(axis=-1, initial=0.0)
        count = int(np.append(turned > SAME, True).argmax())
        if count + 1 < len(near) and _leaps(clip, character, body, count):
            stepped = Stepped.of(clip, joints_read(character)).held
            return None if len(stepped) else float(clip.times[count])
    return None


def _leaps(clip: Clip, character: Character, body: np.ndarray, sample: int) -> bool:
    """Whether the step to a sample is far, as the next one does not go on, and hair feels it."""
    around = slice(sample - 1, sample + 2)
    spans, joints = np.diff(clip.times[around]), clip.joints[around]
    if spans[0] >= LONGEST:
        return False

    def beyond(steps: np.ndarray) -> float:
        """Of steps (2, ...), the most by which the first is farther than the second at its speed."""
        return float((steps[0] - steps[1] * spans[0] / spans[1]).max())

    own = _turns(character, body, joints)
    read = [joint for joint in joints_read(character)[:2] if joint in body]
    world = rotation_part(joints[:, read], "animation")
    felt = beyond(angle_between(world[1:], world[:-1])) > FELT if read else False
    shift = np.linalg.norm(np.diff(character.head_place(joints), axis=0), axis=-1)
    return beyond(angle_between(own[1:], own[:-1])) > FAR and (felt or beyond(shift) > FELT_SHIFT)


def _readable_body(character: Character, joints: np.ndarray) -> np.ndarray:
    """The head's joint, and those not below it, that hang from a joint and have a rotation in all of some poses (n, J, 4, 4), as has
    the joint that each hangs from.
    """
    parents, linear = character.skeleton.parents, joints[..., :3, :3]
    readable = (~flat(linear) & (volumes(linear) > 0)).all(axis=0)
    body = ~character.of_head
    body[character.head] = True
    return np.flatnonzero(body & (parents >= 0) & readable & readable[parents])


def _turns(character: Character, body: np.ndarray, joints: np.ndarray) -> np.ndarray:
    """Rotations (..., n, 3, 3) of joints (n,) as seen from those that they hang from, for world transforms (..., J, 4, 4)."""
    own, above = (
        rotation_part(joints[..., each, :, :], "animation") for each in (body, character.skeleton.parents[body])
    )
    return np.swapaxes(above, -1, -2) @ own
