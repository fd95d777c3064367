# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages about frames at which a character jumps to another place, or out of a reference pose."""

import numpy as np

from neuralocks_core.animation.cuts import APART, find_flashes
from neuralocks_core.animation.reference_pose import reference_end
from neuralocks_core.character import Character
from neuralocks_core.motion import Clip

MOST = 6
"""Frames that are named."""


def leaps_told(clip: Clip, character: Character, frames: np.ndarray) -> tuple[str, ...]:
    """Lines for the panel, for motion that does not loop: a loop has no cuts.

    Args:
        clip: the motion, with its cuts.
        character: that it moves.
        frames: of its samples (T,).
    """

    def named(times: np.ndarray) -> str:
        found = frames[np.searchsorted(clip.times, times - 1e-9)]
        return ", ".join(f"{frame:g}" for frame in found[:MOST]) + (", ..." if len(found) > MOST else "")

    told, flashes = [], find_flashes(clip, character.head)
    if len(clip.cuts):
        told.append(f"The head jumps to another place at frame {named(clip.cuts)}: hair starts anew there")
    if len(flashes):
        told.append(
            f"The head jumps at frame {named(flashes)}, less than {APART:g} s from one jump to the next, and flings the hair; "
            "fix the animation there"
        )
    end = reference_end(clip, character, [character.skeleton.bind])
    if end is not None and not np.isclose(np.union1d(clip.cuts, flashes), end).any():
        told.append(
            f"The motion leaps out of the rest pose at frame {named(np.array([end]))} and flings the hair; if that pose is only a "
            "reference, begin the frame range there"
        )
    return tuple(told)
