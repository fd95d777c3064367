# SPDX-License-Identifier: Apache-2.0
"""Hairstyles on a USD character: they sit on its head, and training can read them back."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from neuralocks_core.errors import NeuralocksError
from usd.grow import grow
from usd.stage import read_rigs

BODY = Path(__file__).resolve().parents[2] / "examples" / "shot" / "body.usdc"


def test_a_style_grows_on_the_head_and_is_repeatable(tmp_path):
    paths = [grow("bob", BODY, tmp_path / f"{i}.usda", count=60, seed=3) for i in (1, 2)]
    stages = [Usd.Stage.Open(str(path)) for path in paths]
    grooms = [next(p for p in stage.Traverse() if p.IsA(UsdGeom.BasisCurves)) for stage in stages]
    points = [np.array(UsdGeom.BasisCurves(prim).GetPointsAttr().Get()) for prim in grooms]
    assert np.array_equal(*points)
    character = read_rigs(BODY)[0].character
    roots = points[0].reshape(60, -1, 3)[:, 0]
    centre = character.canonical_to_bind[:3, 3] + character.head_centre
    assert np.linalg.norm(roots - centre, axis=1).max() < 0.2


def test_unknown_styles_are_listed(tmp_path):
    with pytest.raises(NeuralocksError, match="long_straight"):
        grow("mullet", BODY, tmp_path / "x.usda")
