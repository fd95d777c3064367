# SPDX-License-Identifier: Apache-2.0
"""Which frames a bake lacks, or hides in the one that it goes over."""

import numpy as np
from pxr import Usd, UsdGeom

from ...border.time_codes import NEAR
from .bake_record import recorded


def gaps(codes: list[float], frame: float, stage: Usd.Stage | None = None) -> list[str]:
    """Where samples are missing, in words such as "between 5 and 9"; regular steps of several frames are not gaps.

    Args:
        codes: time codes of a groom's samples, ascending.
        frame: time codes between two frames.
        stage: the shot, whose ends count if it names them; None for a part of it, which has ends of its own.
    """
    named = stage is not None and stage.HasAuthoredTimeCodeRange()
    first, last = (stage.GetStartTimeCode(), stage.GetEndTimeCode()) if named else (codes[0], codes[-1])
    frames = np.unique(np.floor((np.array(codes) - codes[0]) / frame + 1e-6)) * frame + codes[0]
    steps = np.diff(frames)
    usual = np.median(steps) if len(steps) > 1 else frame
    found = [f"between {frames[i]:g} and {frames[i + 1]:g}" for i in np.flatnonzero(steps > 1.5 * usual)]
    missed = usual - NEAR * frame  # a shot may begin and end off a frame; less than a step is not a gap
    found = ([f"before {codes[0]:g}"] if codes[0] - first >= missed else []) + found
    return found + ([f"after {codes[-1]:g}"] if last - frames[-1] >= missed else [])


def some(missing: list[str]) -> str:
    """The first few places of `gaps`, for a note; empty if there are none."""
    return ", ".join(missing[:4]) + (", ..." if missing[4:] else "")


def thinned(codes: list[float], frame: float) -> list[str]:
    """The note on frames with at most half as many samples as others: a part that lacks its sub-frames."""
    if len(codes) < 3 or np.ptp(np.diff(codes)) < 1e-6 * frame:
        return []
    numbers, counts = np.unique(np.floor((np.array(codes) - codes[0]) / frame + 1e-6), return_counts=True)
    counts = counts[:-1]  # a range such as 1:9:0.5 ends with its last frame's first sample
    fewer = np.flatnonzero(2 * counts <= counts.max(initial=0))
    if not len(fewer):
        return []
    first = codes[0] + numbers[fewer[0]] * frame
    return [
        f"{len(fewer)} of {len(numbers)} frames, the first at {first:g}, have fewer samples than others, which have "
        f"{counts.max()}; bake them again with the same --subframes, unless that is meant"
    ]


def hidden(prim: Usd.Prim, codes: list[float], frame: float) -> list[str]:
    """The note on samples of an earlier bake of a groom that a new one at time codes hides, so that hair stands still there.

    Args:
        prim: the groom.
        codes: ascending.
        frame: time codes between two frames.
    """
    former = UsdGeom.BasisCurves(prim).GetPointsAttr().GetTimeSamples() if recorded(prim) else []
    outside = [code for code in former if not codes[0] - frame / 2 < code < codes[-1] + frame / 2]
    if not outside:
        return []
    new = f"{codes[0]:g} to {codes[-1]:g}" if codes[1:] else f"{codes[0]:g}"
    return [
        f"{prim.GetPath()}: is baked already at time codes {former[0]:g} to {former[-1]:g}, which the new samples, at {new}, hide "
        "everywhere, so that hair stands still before and after; bake all frames, or join this part with those of the others"
    ]
