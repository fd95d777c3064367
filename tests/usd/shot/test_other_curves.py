# SPDX-License-Identifier: Apache-2.0
"""Hair as NURBS or Hermite curves beside BasisCurves, or as copies by a point instancer, which a bake leaves out."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, Vt

from neuralocks_core.errors import NeuralocksError
from usd.review.inspect import inspect
from usd.shot.stage import read_shot

from ..shots import CENTRE, Recipe, strand_points, write_shot


@pytest.fixture
def shot(tmp_path):
    return Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="mesh"))))


def curves(stage, kind, path, strands):
    made = kind.Define(stage, path)
    made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.concatenate(strands).astype(np.float32)))
    made.CreateCurveVertexCountsAttr([len(strand) for strand in strands])
    stage.Save()


def told(stage, name):
    path = stage.GetRootLayer().realPath
    shot, facts = read_shot(path), inspect(path)
    assert [item.path for item in shot.grooms] == ["/Hero/Hair"] and not facts["stops"]
    notes, spoils = ([line for line in lines if name in line] for lines in (shot.notes, facts["spoils"]))
    assert notes == spoils
    return notes


@pytest.mark.parametrize("kind", [UsdGeom.NurbsCurves, UsdGeom.HermiteCurves])
def test_hair_of_other_kinds_is_told(shot, kind):
    """On the skin, with each guide in its own prim, and some way off the skin."""
    strands = strand_points(40, 12)
    curves(shot, kind, "/Hero/Locks", strands)
    (line,) = told(shot, "/Hero/Locks")
    assert "convert them to BasisCurves" in line and kind.__name__ in line
    assert not [note for note in read_shot(shot.GetRootLayer().realPath, ["/Hero/Hair"]).notes if "Locks" in note]
    curves(shot, kind, "/Hero/Guide", strands[:1])
    curves(shot, kind, "/Hero/Aura", strands + [0, 0.3, 0])
    assert len(told(shot, "/Hero/Guide")) == len(told(shot, "/Hero/Aura")) == 1


def test_a_character_that_a_point_instancer_copies_keeps_its_hair(tmp_path):
    path = write_shot(tmp_path, Recipe(nesting="/Crowd/Kinds/Hero"))
    stage = Usd.Stage.Open(str(path))
    UsdGeom.PointInstancer.Define(stage, "/Crowd").CreatePrototypesRel().SetTargets(["/Crowd/Kinds/Hero"])
    stage.Save()
    assert [item.path for item in read_shot(path).grooms] == ["/Crowd/Kinds/Hero/Hair"]


@pytest.mark.parametrize("moved", ["positions", "orientations", "velocities", ""])
def test_a_crowd_that_a_point_instancer_moves_is_told(tmp_path, moved):
    path = write_shot(tmp_path, Recipe(nesting="/Crowd/Kinds/Hero"))
    stage = Usd.Stage.Open(str(path))
    crowd = UsdGeom.PointInstancer.Define(stage, "/Crowd")
    crowd.CreatePrototypesRel().SetTargets(["/Crowd/Kinds/Hero"])
    crowd.CreateProtoIndicesAttr([0, 0])
    for code in (0, 8):
        crowd.CreatePositionsAttr().Set([(0, 0, code if moved == "positions" else 0), (2, 0, 0)], code)
        turned = Gf.Quath(0, 0, 1, 0) if code and moved == "orientations" else Gf.Quath(1)
        crowd.CreateOrientationsAttr().Set([Gf.Quath(1), turned], code)
        crowd.CreateVelocitiesAttr().Set([(0, 0, moved == "velocities"), (0, 0, 0)], code)
    stage.Save()
    notes = [note for note in read_shot(path).notes if note.startswith("/Crowd: moves its copies")]
    assert len(notes) == bool(moved)


def test_copies_by_a_point_instancer_are_told(shot):
    UsdGeom.PointInstancer.Define(shot, "/Hero/Tufts").CreatePrototypesRel().SetTargets(["/Hero/Tufts/Kinds/Tuft"])
    curves(shot, UsdGeom.BasisCurves, "/Hero/Tufts/Kinds/Tuft", strand_points(7, 12))
    (line,) = told(shot, "/Hero/Tufts/Kinds/Tuft")
    assert "drawn as copies by the PointInstancer /Hero/Tufts," in line and "make each copy curves of its own" in line
    path = shot.GetRootLayer().realPath
    with pytest.raises(NeuralocksError, match="PointInstancer /Hero/Tufts, which no bake moves"):
        read_shot(path, ["/Hero/Tufts"])
    shot.RemovePrim("/Hero/Hair")
    shot.Save()
    with pytest.raises(NeuralocksError, match="Kinds/Tuft: is drawn as copies"):
        read_shot(path)


@pytest.mark.parametrize("later", [False, True])
def test_what_a_scale_of_zero_hides_stops_no_bake(shot, later):
    curves(shot, UsdGeom.NurbsCurves, "/Hero/Locks", strand_points(40, 12))
    scale = UsdGeom.Xformable(shot.GetPrimAtPath("/Hero/Locks")).AddScaleOp()
    for code in (1, 5) if later else (5,):
        scale.Set((1, 1, 1) if code == 1 else (0, 0, 0), code)
    shot.Save()
    assert not told(shot, "/Hero/Locks")


def test_what_is_no_hair_is_not(shot):
    """Cables of a set, a control ring, and a line from the head to what it looks at."""
    cables = np.random.default_rng(0).uniform(4, 9, (9, 5, 3))
    turn = np.linspace(0, 2 * np.pi, 11)
    ring = CENTRE + 0.11 * np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    ring[8:] = ring[:3]
    curves(shot, UsdGeom.NurbsCurves, "/Set/Cables", cables)
    curves(shot, UsdGeom.NurbsCurves, "/Hero/Ring", [ring])
    curves(shot, UsdGeom.NurbsCurves, "/Hero/Aim", [CENTRE + [[0, 0, 0.2], [0, 0, 0.5]]])
    assert not told(shot, "/Set/Cables") + told(shot, "/Hero/Ring") + told(shot, "/Hero/Aim")


def test_it_is_the_error_where_the_basis_curves_are_no_hair(shot):
    curves(shot, UsdGeom.NurbsCurves, "/Hero/Locks", strand_points(40, 12))
    shot.RemovePrim("/Hero/Hair")
    curves(shot, UsdGeom.BasisCurves, "/Set/Grass", strand_points(9, 4) + [6, 0, 0])
    with pytest.raises(NeuralocksError, match="/Hero/Locks.*convert"):
        read_shot(shot.GetRootLayer().realPath)
