# SPDX-License-Identifier: Apache-2.0
"""Curves as they are written: what Blender and USD's renderers read of their widths."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from usd.assets.prims import POLYLINES, author_curves
from usd.shot.strands.curves import widths_attribute

COUNTS = [2, 3]
POINTS = np.arange(15.0).reshape(5, 3)
OF_EACH = [1, 1, 2, 2, 2]


@pytest.mark.parametrize("as_primvar", [False, True])
@pytest.mark.parametrize(
    ("given", "written", "interpolation"),
    [([3], [3], "constant"), ([1, 2], OF_EACH, "vertex"), ([1, 2, 3, 4, 5], [1, 2, 3, 4, 5], "vertex")],
    ids=["all", "strand", "vertex"],
)
def test_widths_are_those_of_all_or_of_each_vertex(given, written, interpolation, as_primvar):
    """Blender reads no others right: not one a strand."""
    stage = Usd.Stage.CreateInMemory()
    curves = author_curves(stage, "/Hair", POINTS, COUNTS, given, POLYLINES, as_primvar)
    assert UsdGeom.PrimvarsAPI(curves).HasPrimvar("widths") == as_primvar
    assert curves.GetWidthsAttr().HasAuthoredValue() != as_primvar
    found = widths_attribute(curves)
    assert list(found.Get()) == written
    told = UsdGeom.Primvar(found).GetInterpolation() if as_primvar else curves.GetWidthsInterpolation()
    assert told == interpolation
    assert curves.GetExtentAttr().Get()[1][0] == 12 + max(given) / 2
