# SPDX-License-Identifier: Apache-2.0
"""Points that Blender imports from a moving groom, and those at rest."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from neuralocks_core.errors import NeuralocksError
from usd.shot.strands.imported import imported_and_rest

POINTS = np.arange(18, dtype=np.float32).reshape(6, 3)


def moving(path, rest: bool) -> str:
    """A file with a groom that moves at time codes -1 to 2, and a mesh-less prim beside it."""
    stage = Usd.Stage.CreateNew(str(path))
    curves = UsdGeom.BasisCurves.Define(stage, "/Hair")
    curves.CreateCurveVertexCountsAttr([4, 2])
    if rest:
        curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(POINTS))
    for code in (-1.0, 0.0, 1.0, 2.0):
        curves.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(POINTS + np.float32(code) + 1), code)
    UsdGeom.Xform.Define(stage, "/Group")
    stage.Save()
    return str(path)


def test_imported_points_are_those_of_time_code_zero_whatever_comes_first(tmp_path):
    imported, rest = imported_and_rest(moving(tmp_path / "a.usda", True), "/Hair")
    np.testing.assert_array_equal(imported, POINTS + 1)
    np.testing.assert_array_equal(rest, POINTS)


@pytest.mark.parametrize(
    ("rest", "prim", "words"),
    [
        (False, "/Hair", "none at rest"),
        (True, "/Gone", "no hair /Gone"),
        (True, "/Group", "no hair"),
        (True, "", "no hair"),
    ],
)
def test_files_without_rest_points_are_refused_in_words(tmp_path, rest, prim, words):
    with pytest.raises(NeuralocksError, match=words):
        imported_and_rest(moving(tmp_path / "a.usda", rest), prim)
