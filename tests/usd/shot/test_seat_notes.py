# SPDX-License-Identifier: Apache-2.0
"""Strands that run from tip to root get a note, and no others."""

from unittest.mock import Mock

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt
from scipy.spatial import cKDTree

from neuralocks_core.body.collider import Collider
from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.shot.carriers import seat_notes
from usd.shot.stage import read_shot
from usd.skel import stage_rig

from ..commands import spoils
from ..shots import CENTRE, RADIUS, Recipe, write_shot


@pytest.mark.parametrize("bound", ["own", "mesh"])
def test_strands_from_tip_to_root_are_told(tmp_path, bound):
    path = write_shot(tmp_path, Recipe(bound=bound))
    assert not any("from tip to root" in note for note in read_shot(path).notes)
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    strands = np.array(points.Get()).reshape(40, -1, 3)
    points.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(strands[:, ::-1].reshape(-1, 3))))
    stage.Save()
    for notes in (read_shot(path).notes, spoils(path)):
        assert sum("from tip to root" in note for note in notes) == 1


def _from_to(path, roots: tuple, tips: tuple, *, turned: bool) -> list[str]:
    """The notes on straight strands between two balls, each given as a centre and a radius [m], whichever end comes first."""
    side = np.random.default_rng(3).normal(size=(40, 3))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    begin, end = (np.array(centre) + radius * side for centre, radius in (roots, tips))
    strands = begin[:, None] + np.linspace(0, 1, 12)[:, None] * (end - begin)[:, None]
    stage = Usd.Stage.Open(str(path))
    points = np.ascontiguousarray((strands[:, ::-1] if turned else strands).reshape(-1, 3), np.float32)
    UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(points))
    stage.Save()
    shot = read_shot(path)
    assert set(shot.notes) == set(spoils(path))
    assert shot.grooms[0].joint.endswith("head")
    return [note for note in shot.notes if note.startswith("/Hero/Hair")]


def test_short_strands_and_those_with_tips_on_the_chest_are_told_too(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    scalp, chest = (CENTRE, RADIUS), ((0, 1.3, 0), 0.16)
    for tips in ((CENTRE, RADIUS + 0.02), chest):
        notes = _from_to(path, scalp, tips, turned=True)
        assert len(notes) == 1 and "from tip to root" in notes[0], notes
        assert not _from_to(path, scalp, tips, turned=False)


def test_a_body_is_prepared_once_for_all_short_hair_on_it(tmp_path, monkeypatch):
    """Brows, lashes and fuzz come in many prims; the surface of a scanned body takes a tenth of a second."""
    made, prepare = [], Collider.__init__
    monkeypatch.setattr(Collider, "__init__", lambda self, *given: made.append(self) or prepare(self, *given))
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    assert _from_to(path, (CENTRE, RADIUS), (CENTRE, RADIUS + 0.02), turned=True)
    stage = Usd.Stage.Open(str(path))
    for name in ("Brow", "Fuzz"):
        Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Hair", stage.GetRootLayer(), f"/Hero/{name}")
    stage.Save()
    made.clear()
    trees = Mock(wraps=cKDTree)
    for module in (seat_notes, stage_rig):
        monkeypatch.setattr(module, "cKDTree", trees, raising=False)
    assert sum("from tip to root" in note for note in read_shot(path).notes) == 3
    assert len(made) == trees.call_count == 1


def test_hair_that_touches_skin_with_its_tips_is_not_taken_for_turned_round(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    above, pressed, on_chest = (CENTRE, RADIUS + 0.008), (CENTRE + [0, 0.005, 0], RADIUS), ((0, 1.3, 0), 0.15)
    for roots, tips in (((CENTRE, RADIUS), pressed), ((CENTRE, RADIUS - 0.01), pressed), (above, on_chest)):
        assert not _from_to(path, roots, tips, turned=False)


def test_skin_without_faces_tells_nothing_of_short_strands(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh.Get(stage, "/Hero/Skin")
    mesh.GetFaceVertexCountsAttr().Set([])
    mesh.GetFaceVertexIndicesAttr().Set([])
    stage.Save()
    assert not _from_to(path, (CENTRE, RADIUS), (CENTRE, RADIUS + 0.01), turned=True)


def test_bound_hair_far_from_the_skin_is_told(tmp_path):
    """For a wrong unit or bind transform, the joint is right, so nothing else shows that the hair moves about a point beside the
    body.
    """
    path = write_shot(tmp_path, Recipe(bound="own"))
    assert not any("geomBindTransform" in note for note in read_shot(path).notes)
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    points.Set(Vt.Vec3fArray.FromNumpy(np.array(points.Get()) + np.float32([5, 0, 0])))
    stage.Save()
    for notes in (read_shot(path).notes, spoils(path)):
        told = [note for note in notes if "geomBindTransform" in note]
        assert len(told) == 1 and told[0].startswith(
            "/Hero/Hair: its skel binding puts its roots 4.8 m from the skin of"
        )


def test_hair_that_points_cannot_place_is_told(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh", unit=0.01))

    def told(moved):
        stage = Usd.Stage.Open(str(path))
        moved(stage)
        stage.Save()
        found = [[note for note in notes if "tremble" in note] for notes in (read_shot(path).notes, spoils(path))]
        assert found[0] == found[1]
        return found[0]

    def by_transform(stage):
        UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddTranslateOp().Set((1e6, 0, 0))

    def by_joints(stage):
        steps = stage.GetPrimAtPath("/Hero/Rig/Motion").GetAttribute("translations")
        for code in steps.GetTimeSamples():
            places = np.array(steps.Get(code))
            places[0, 0] += 1e6 * (code - 1) / 8
            steps.Set(Vt.Vec3fArray.FromNumpy(places), code)

    assert told(by_transform) == []
    (note,) = told(by_joints)
    assert note.startswith(
        "/Hero/Hair: the head is up to 10000 m from this prim's origin, where points only move in steps of 0.62 mm"
    )


def test_hair_that_is_flat_for_a_while_is_baked_until_then(tmp_path, still_model):
    path = write_shot(tmp_path, Recipe(bound="own"))
    stage = Usd.Stage.Open(str(path))
    size = UsdGeom.Xformable(stage.GetPrimAtPath("/Hero/Hair")).AddScaleOp()
    size.Set((1, 1, 1), 6)
    size.Set((1, 0, 1), 9)
    stage.Save()
    assert bake(path, tmp_path / "bake.usdc", still_model, frames="1:4").frames == [1, 2, 3, 4]
    with pytest.raises(NeuralocksError, match="/Hero/Hair: its transform at time code 9 has zero scale"):
        bake(path, tmp_path / "bake.usdc", still_model)
