# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages about frames at which a character jumps to another place."""

import numpy as np

from neuralocks_core.animation.cuts import APART, find_flashes
from neuralocks_core.motion import Clip

MOST = 6
"""Frames that are named."""


def leaps_told(clip: Clip, joint: int, frames: np.ndarray) -> tuple[str, ...]:
    """Lines for the panel, for motion that does not loop: a loop has no cuts.

    Args:
        clip: the motion, with its cuts.
        joint: the head.
        frames: of its samples (T,).
    """

    def named(times: np.ndarray) -> str:
        found = frames[np.searchsorted(clip.times, times - 1e-9)]
        return ", ".join(f"{frame:g}" for frame in found[:MOST]) + (", ..." if len(found) > MOST else "")

    told, flashes = [], find_flashes(clip, joint)
    if len(clip.cuts):
        told.append(f"The head jumps to another place at frame {named(clip.cuts)}: hair starts anew there")
    if len(flashes):
        told.append(
            f"The head jumps at frame {named(flashes)}, less than {APART:g} s from one jump to the next, and flings the hair; "
            "fix the animation there"
        )
    return tuple(told)
