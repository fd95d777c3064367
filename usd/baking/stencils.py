# SPDX-License-Identifier: Apache-2.0
"""Velocities as differences of neighbouring frames, which a bake computes anyway."""

import numpy as np

from ..border.time_codes import NEAR, on_frame
from ..shot.stage import StageGroom
from .layer.sample_layer import in_order


class Stencils:
    """Which samples of a groom the velocity at each time code is computed from.

    Central differences over one and two frames on both sides, accurate to fourth order: at 24 frames a second within 2 % for hair
    that swings three times a second. Where the animation begins and ends, and at a cut, where the character jumps, differences are
    one-sided, to second order: before the first sample hair is at rest, or only a wind moves it; after the last one the body stands
    still and hair swings on. The velocity at a time code depends on that time code only, not on which others are baked.

    Args:
        item: the groom.
        codes: ascending time codes of the samples.
        origin: the shot's first time code, from which frames are counted.
        velocities: whether velocities are wanted at all.
        blown: whether there is a wind.

    Attributes:
        wanted: time codes to write.
        codes: ascending time codes at which points are needed.
        puts: in writing order, "points" or "velocities", the time code, and the time codes at which it needs points.
    """

    def __init__(
        self, item: StageGroom, codes: list[float], origin: float, velocities: bool = True, blown: bool = False
    ):
        self.wanted = dict.fromkeys(codes)
        clip, moving = item.attachment.rig.time_codes, item.placement.samples
        rig, border = item.attachment.rig, item.attachment.rig.border
        self._first, self._last = min([clip[0], *moving[:1]]), max([clip[-1], *moving[-1:]])
        if blown and self._first == self._last:  # the body never moves, so no time differs from others
            self._last = -np.inf
        after = np.searchsorted(rig.clip.times, rig.clip.cuts - 1e-9)
        self._before, self._after = clip[after - 1], clip[after]
        self._blown = blown
        self._origin, self._step, self._rate = origin, border.frame, border.rate / border.frame
        # Neighbours that are samples themselves keep exactly the same number.
        self._known = np.array(codes, float)
        self.puts: list[tuple[str, float, list[float]]] = [
            (name, code, [code] if name == "points" else [other for other, _ in self.terms(code)])
            for name, code in in_order(codes, self._step, velocities)
        ]
        self.codes = sorted(set().union(*(needs for _, _, needs in self.puts)))

    def terms(self, code: float) -> list[tuple[float, float]]:
        """(time code, weight per second) whose weighted sum of points is the velocity at `code`."""
        step = self._step
        slack = NEAR * step  # samples of the animation may be rounded, and frames are not
        part = int(np.searchsorted(self._after - slack, code, side="right"))
        first = self._after[part - 1] if part else self._first
        last = self._before[part] if part < len(self._before) else self._last
        if code > self._last + slack:
            first, last = self._last, np.inf
        elif self._blown and code < self._first - slack:
            first, last = -np.inf, self._first
        room = (code - first) / step + NEAR, (last - code) / step + NEAR
        if min(room) >= 2:
            weights = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
        elif min(room) >= 1:
            weights = {-1: -0.5, 1: 0.5}
        elif max(room) >= 2 and min(room) >= 0:
            sign = 1 if room[1] >= 2 else -1
            weights = {0: -1.5 * sign, sign: 2.0 * sign, 2 * sign: -0.5 * sign}
        elif max(room) >= 1 and min(room) >= 0:
            sign = 1 if room[1] >= 1 else -1
            weights = {0: -1.0 * sign, sign: 1.0 * sign}
        else:
            weights = {}
        return [(self._snapped(code + place * step), self._rate * weight) for place, weight in weights.items()]

    def _snapped(self, code: float) -> float:
        near = int(np.searchsorted(self._known, code - 1e-6))
        if near < len(self._known) and abs(self._known[near] - code) < 1e-6:
            return float(self._known[near])
        return on_frame(float(code), self._origin, self._step)
