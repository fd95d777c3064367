# SPDX-License-Identifier: Apache-2.0
"""A prim's local-to-world transform at any time, and the times at which it is authored, in samples or as the knots of
splines.
"""

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from pxr import Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError

from .arrays import column_matrix

KEPT = 64
"""How many transforms of a prim are cached: in a crowd, each groom is compared with the same few of each character."""


class Unplaced(NeuralocksError):
    """A prim cannot be placed at some time: its transform, or one above, has zero scale or is not finite.

    Attributes:
        prim: the prim to be placed.
        fact, remedy: what is wrong, and what to do, in words.
    """

    def __init__(self, prim: Usd.Prim, fact: str, remedy: str):
        super().__init__(f"{prim.GetPath()}: {fact}; {remedy}")
        self.prim, self.fact, self.remedy = prim, fact, remedy


class Placement:
    """Local-to-world transforms of one prim in stage space; evaluated once where nothing above it moves.

    Args:
        prim: what is placed.
        brought: from its stage's space to the one that is meant (4, 4), if that is another stage's.
    """

    def __init__(self, prim: Usd.Prim, brought: np.ndarray | None = None):
        self.prim, self.brought = prim, brought
        self.samples: list[float] = []
        for xformable in _upwards(prim):
            if xformable.TransformMightBeTimeVarying():
                self.samples += [*xformable.GetTimeSamples(), *_knots(xformable)]
        self.samples = sorted(set(self.samples))
        self._known: dict[float, np.ndarray] = {}

    @cached_property
    def _still(self) -> np.ndarray | None:
        """The only place of a prim that stands still; evaluated only when needed, since a prim that is left out may have none."""
        # Exporters write what stands still as a single sample without a default: at the default time, its scale would be lost.
        return None if self.samples else self._evaluate(Usd.TimeCode.EarliestTime())

    def at(self, time_code: float) -> np.ndarray:
        """Transform (4, 4) at a time code; do not modify it.

        Raises:
            NeuralocksError: it is not finite or flattens space.
        """
        if self._still is not None:
            return self._still
        found = self._known.get(time_code)
        if found is None:
            if len(self._known) >= KEPT:
                self._known.clear()  # other threads may be about to look there
            found = self._evaluate(Usd.TimeCode(time_code))
            found.flags.writeable = False
            self._known[time_code] = found
        return found

    @property
    def reference(self) -> np.ndarray:
        """Transform (4, 4) at rest: the only place of a prim that does not move, otherwise its place at the first sample."""
        return self._still if self._still is not None else self.at(self.samples[0])

    @property
    def lone_samples(self) -> list[float]:
        """Time codes at which an exporter wrote a transform that does not move, of this prim or of one above."""
        times = [xformable.GetTimeSamples() for xformable in _upwards(self.prim)]
        return [own[0] for own in times if len(own) == 1]

    @property
    def usable(self) -> bool:
        """Whether the prim can be placed at rest."""
        try:
            return self.reference is not None
        except Unplaced:
            return False

    def whose(self, wrong: Callable[[np.ndarray], bool], time_code: float | None = None) -> str:
        """Whose transform is wrong, in words: the prim's own, or that of a prim above.

        Args:
            wrong: whether a transform (4, 4) is wrong.
            time_code: when; at rest if left out.
        """
        code = self.samples[0] if time_code is None and self.samples else time_code
        time = Usd.TimeCode.EarliestTime() if code is None else Usd.TimeCode(code)
        for each in _upwards(self.prim):
            if wrong(column_matrix(each.GetLocalTransformation(time))):
                return "its transform" if each.GetPrim() == self.prim else f"the transform of {each.GetPath()} above it"
        return "its transform with those above it"

    def _evaluate(self, time: Usd.TimeCode) -> np.ndarray:
        matrix = column_matrix(UsdGeom.XformCache(time).GetLocalToWorldTransform(self.prim))
        for fact, wrong, remedy in (
            ("holds NaN or infinity", _broken, "repair it"),
            ("has zero scale", _flat, "give it a scale above zero, or hide what is below by its visibility"),
        ):
            if wrong(matrix):
                code = None if time.IsEarliestTime() else time.GetValue()
                when = "" if code is None else f" at time code {code:g}"
                whose = self.whose(wrong, code)
                raise Unplaced(self.prim, f"{whose}{when} {fact}", remedy)
        return matrix if self.brought is None else self.brought @ matrix


def _upwards(prim: Usd.Prim) -> Iterator[UsdGeom.Xformable]:
    """A prim and the prims above that place it, as far as they have transforms."""
    while prim and not prim.IsPseudoRoot():
        if xformable := UsdGeom.Xformable(prim):
            yield xformable
            if xformable.GetResetXformStack():
                return
        prim = prim.GetParent()


def _broken(matrix: np.ndarray) -> bool:
    return not np.isfinite(matrix).all()


def _flat(matrix: np.ndarray) -> bool:
    return abs(np.linalg.det(matrix[:3, :3])) < 1e-18


def _knots(xformable: UsdGeom.Xformable) -> list[float]:
    """Time codes at which the transform's splines have knots: animation curves, which USD does not count as samples."""
    curves = [op.GetAttr() for op in xformable.GetOrderedXformOps()]
    splined = [curve for curve in curves if getattr(curve, "HasSpline", bool)()]  # older versions of USD have none
    return [time for curve in splined for time in curve.GetSpline().GetKnots().keys()]
