# SPDX-License-Identifier: Apache-2.0
"""Which sample of an animation a cut that a user names belongs to: the first one at the new place."""

from collections.abc import Sequence

import numpy as np

from ..border.time_codes import NEAR


def cut_samples(cuts: Sequence[float], codes: np.ndarray, frame: float, poses: np.ndarray) -> np.ndarray:
    """Indices (C,) of samples, ascending; cuts that are not `within` the animation are left out.

    A user names the first frame that shows the new place. If no sample lies there, it is the one of those in the frame before and
    the next one to which the head moves farthest: samples need not lie on frames, and numbers are rounded.

    Args:
        cuts: time codes.
        codes: (T,) time codes of the samples, ascending.
        frame: time codes from one frame to the next.
        poses: (T, n) of the head: its place, and its axes if it may only turn.
    """
    steps = np.linalg.norm(np.diff(poses, axis=0, prepend=poses[:1]), axis=1)
    found = set()
    for cut in cuts:
        if not within(cut, codes, frame):
            continue
        nearest, following = 1 + int(np.argmin(np.abs(codes[1:] - cut))), int(np.searchsorted(codes, cut))
        if abs(codes[nearest] - cut) <= NEAR * frame:
            found.add(nearest)
        else:
            around = 1 + np.flatnonzero((codes[1:] > cut - frame) & (codes[1:] <= codes[following]))
            found.add(int(around[np.argmax(steps[around])]))
    return np.array(sorted(found), int)


def within(cut: float, codes: np.ndarray, frame: float) -> bool:
    """Whether a cut comes after the first sample of an animation and not after its last."""
    return codes[0] + NEAR * frame < cut <= codes[-1] + NEAR * frame
