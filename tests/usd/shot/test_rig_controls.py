# SPDX-License-Identifier: Apache-2.0
"""Control curves of a rig beside hair, as Maya rigs are exported with them."""

import numpy as np
import pytest
from pxr import Usd, UsdGeom, Vt

from neuralocks_core.errors import NeuralocksError
from usd.review.inspect import inspect
from usd.shot.stage import read_shot

from ..shots import CENTRE, RADIUS, Recipe, write_shot

RING = np.linspace(0, 2 * np.pi, 16, endpoint=False)
CIRCLES = {"Head": CENTRE + [0, 0.2, 0], "Jaw": CENTRE + [0, -0.05, 0.15], "Hand": [0.7, 1.4, 0]}


def curve(stage, path, points, *, closed=False, guide=True):
    curves = UsdGeom.BasisCurves.Define(stage, path)
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(points, np.float32)))
    curves.CreateCurveVertexCountsAttr([len(points)])
    curves.CreateWrapAttr("periodic" if closed else "pinned")
    if guide:
        curves.CreatePurposeAttr("guide")


@pytest.fixture
def shot(tmp_path):
    """Hair, three control circles, one of them hanging free, and a straight line from a hand to its pole."""
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="mesh"))))
    for name, centre in CIRCLES.items():
        ring = 0.1 * np.stack([np.cos(RING), 0 * RING, np.sin(RING)], axis=1) + centre
        curve(stage, f"/Hero/Controls/{name}", ring, closed=True, guide=name != "Jaw")
    curve(stage, "/Hero/Controls/Pole", [(0.5, 1.5, 0), (0.5, 1.5, -0.5)])
    stage.Save()
    return stage


def test_they_are_no_hair_and_one_line_says_so(shot):
    path = shot.GetRootLayer().realPath
    read, facts = read_shot(path), inspect(path)
    assert [item.path for item in read.grooms] == ["/Hero/Hair"] == [groom["path"] for groom in facts["grooms"]]
    for lines in (read.notes, facts["spoils"]):
        assert [line for line in lines if "Controls" in line and "3 more prims" in line and "--groom" in line]
        assert sum("Controls" in line for line in lines) == 1
    named = read_shot(path, ["/Hero/Controls/Head"])
    assert [item.path for item in named.grooms] == ["/Hero/Controls/Head"]
    assert any("closed" in note and "as hair that begins" in note for note in named.notes)


def test_where_nothing_else_is_there_they_are_the_error(shot):
    shot.RemovePrim("/Hero/Hair")
    shot.Save()
    path = shot.GetRootLayer().realPath
    with pytest.raises(NeuralocksError, match="Controls/.*a rig's controls.*--groom"):
        read_shot(path)
    assert sum("Controls" in line for line in inspect(path)["stops"]) == 1


def test_guides_of_a_groom_stay_hair(shot):
    """One on skin in its own prim, and several that hover over skin."""
    root = CENTRE + [0, RADIUS, 0]
    curve(shot, "/Hero/Guide", root + np.linspace(0, 0.1, 8)[:, None] * [0, 1, 0])
    curve(shot, "/Hero/Guides", root + [0, 0.05, 0] + np.linspace(0, 0.1, 8)[:, None] * [0, 1, 0])
    UsdGeom.BasisCurves(shot.GetPrimAtPath("/Hero/Guides")).GetCurveVertexCountsAttr().Set([4, 4])
    shot.Save()
    grooms = [item.path for item in read_shot(shot.GetRootLayer().realPath).grooms]
    assert sorted(grooms) == ["/Hero/Guide", "/Hero/Guides", "/Hero/Hair"]
