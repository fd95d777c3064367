# SPDX-License-Identifier: Apache-2.0
"""Where a prim stands: its local-to-world transform at any time, and at which times that is authored, in samples or as
the knots of splines.
"""

import numpy as np
from pxr import Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError

from .arrays import column_matrix

KEPT = 64
"""So many places of a prim are remembered: in a crowd each groom is held against the same few of each character."""


class Placement:
    """Local-to-world transforms of one prim in stage space; evaluated once where nothing above it moves."""

    def __init__(self, prim: Usd.Prim):
        self.prim = prim
        self.samples: list[float] = []
        walk = prim
        while walk and not walk.IsPseudoRoot():
            xformable = UsdGeom.Xformable(walk)
            if xformable:
                if xformable.TransformMightBeTimeVarying():
                    self.samples += [*xformable.GetTimeSamples(), *_knots(xformable)]
                if xformable.GetResetXformStack():
                    break
            walk = walk.GetParent()
        self.samples = sorted(set(self.samples))
        self._known: dict[float, np.ndarray] = {}
        # Exporters key what stands still with a single sample and no default: the default time would drop its scale.
        self._still = None if self.samples else self._evaluate(Usd.TimeCode.EarliestTime())

    def at(self, time_code: float) -> np.ndarray:
        """Transform (4, 4) at a time code; not to be written to.

        Raises:
            NeuralocksError: it is not finite or flattens space.
        """
        if self._still is not None:
            return self._still
        if time_code not in self._known:
            if len(self._known) >= KEPT:
                self._known.clear()
            self._known[time_code] = self._evaluate(Usd.TimeCode(time_code))
            self._known[time_code].flags.writeable = False
        return self._known[time_code]

    @property
    def reference(self) -> np.ndarray:
        """Transform (4, 4) at rest: the one place of a prim that does not move, else its place at the first sample."""
        return self._still if self._still is not None else self.at(self.samples[0])

    def _evaluate(self, time: Usd.TimeCode) -> np.ndarray:
        matrix = column_matrix(UsdGeom.XformCache(time).GetLocalToWorldTransform(self.prim))
        when = "" if time.IsEarliestTime() else f" at time code {time.GetValue():g}"
        if not np.isfinite(matrix).all():
            raise NeuralocksError(
                f"{self.prim.GetPath()}: its transform{when} holds NaN or infinity; repair it or a parent's"
            )
        if abs(np.linalg.det(matrix[:3, :3])) < 1e-18:
            raise NeuralocksError(
                f"{self.prim.GetPath()}: its transform{when} has zero scale; give it and its parents a scale above zero"
            )
        return matrix


def _knots(xformable: UsdGeom.Xformable) -> list[float]:
    """Time codes at which the transform's splines have knots: animation curves, of which USD counts no samples."""
    curves = [op.GetAttr() for op in xformable.GetOrderedXformOps()]
    splined = [curve for curve in curves if getattr(curve, "HasSpline", bool)()]  # older versions of USD know none
    return [time for curve in splined for time in curve.GetSpline().GetKnots().keys()]
