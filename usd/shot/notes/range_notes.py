# SPDX-License-Identifier: Apache-2.0
"""Notes on the time codes of a bake: whether the animation covers them, and what the stage says of its range and of frames."""

import math
from collections.abc import Iterable

import numpy as np
from pxr import Usd

from ...skel.stage_rig import StageRig
from .stage_notes import unsaved_notes

BLURRED = 16
"""A frame has no more samples than these for motion blur."""


def asked_notes(stage: Usd.Stage, rigs: Iterable[StageRig], codes: list[float], loop: bool) -> list[str]:
    """The notes on what a bake was asked for.

    Args:
        stage: the shot.
        rigs: skeletons that carry what is baked.
        codes: the time codes, ascending.
        loop: hair moves on outside of the animation, too, as `StageRig.loop_notes` tells.
    """
    out = [text for rig in rigs if not loop for text in out_of_range(rig, codes[0], codes[-1])]
    return unsaved_notes(stage) + without_range(stage) + out


def without_range(stage: Usd.Stage) -> list[str]:
    """The note on a range of the stage that cannot be meant."""
    first, last = stage.GetStartTimeCode(), stage.GetEndTimeCode()
    if not stage.HasAuthoredTimeCodeRange() or -math.inf < first <= last < math.inf:
        return []
    return [
        f"{stage.GetRootLayer().GetDisplayName()}: from its startTimeCode {first:g} to its endTimeCode {last:g} is no range, so the "
        "animation's own counts; author both"
    ]


def out_of_range(rig: StageRig, first: float, last: float) -> list[str]:
    """The note on an animation that lies within one frame, or on a range of time codes that it mostly does not cover, so that the
    character stands still.
    """
    samples, frame = rig.joints.keys.every, rig.border.frame
    if len(samples) < 2:
        return []
    if len(samples) > BLURRED and samples[-1] - samples[0] < frame:
        return [
            f"{rig.path}: all {len(samples)} samples of its animation lie within one frame, which is {frame:g} time codes; check the "
            "stage's timeCodesPerSecond and framesPerSecond"
        ]
    within = min(samples[-1], last) - max(samples[0], first)
    if within >= 0.5 * (last - first) or _moves_on(rig, first, last):  # a shot may have handles
        return []
    much, held = ("none of it", "a held pose") if within < 0 else ("little of it", "elsewhere a held pose")
    return [
        f"{rig.path}: its animation lies at time codes {samples[0]:g} to {samples[-1]:g}, {much} within {first:g} to "
        f"{last:g}: {held}; check --frames, the shot's range and the layer offsets"
    ]


def _moves_on(rig: StageRig, first: float, last: float) -> bool:
    """Whether what places a character moves before its first key or after its last one: a spline may loop."""
    keys, placed = rig.joints.keys.every, rig.joints.placement
    codes = [code for code in np.linspace(first, last, 9) if not keys[0] <= code <= keys[-1]]
    ends = np.clip(codes, keys[0], keys[-1])
    return not all(np.allclose(placed.at(code), placed.at(end)) for code, end in zip(codes, ends))
