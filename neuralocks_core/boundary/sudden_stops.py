# SPDX-License-Identifier: Apache-2.0
"""Sudden starts and stops of a character, limited where they happen: at a sample of its clip."""

from dataclasses import replace

import numpy as np

from neuralocks_core.character import Character
from neuralocks_core.motion import Clip, G


def softened(clip: Clip, character: Character, most: float, step: float) -> Clip:
    """Limit how much the head's velocity changes from one sample to the next, to what `most` g cause in the time between them, or
    in `step` if that is longer. Returns the clip itself if no change exceeds this.

    The network reads means over steps. If blows were limited only there, one within a single step would be cut, but one shared by
    two steps would pass at up to twice the limit: hair would flicker, since the steps move on with every frame.

    Args:
        clip: without cuts. A loop is left unchanged: its seam would no longer fit.
        character: whose head it is.
        most: [g].
        step: [s].
    """
    if clip.loop or len(clip.times) < 3:
        return clip
    place, spans = character.head_place(clip.joints), np.diff(clip.times)
    velocity = np.diff(place, axis=0) / spans[:, None]
    kicks = np.diff(velocity, axis=0)
    size, allowed = np.linalg.norm(kicks, axis=1), most * G * np.maximum((spans[1:] + spans[:-1]) / 2, step)
    if not (size > allowed).any():
        return clip
    kicks *= np.minimum(1.0, allowed / np.maximum(size, 1e-12))[:, None]
    velocity[1:] = velocity[0] + np.cumsum(kicks, axis=0)
    path = place[0] + np.cumsum(velocity * spans[:, None], axis=0)
    joints = clip.joints.copy()
    joints[1:, :, :3, 3] += (path - place[1:])[:, None]
    return replace(clip, joints=joints)
