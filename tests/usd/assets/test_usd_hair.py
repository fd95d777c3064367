# SPDX-License-Identifier: Apache-2.0
"""Hair of a USD file that has its own character, put on another's head."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom
from scipy.spatial.transform import Rotation

from neuralocks_core.errors import NeuralocksError
from usd.assets.importing import import_groom
from usd.shot.stage import read_shot

from ..shots import HEAD, Recipe, write_shot

BODY = Path(__file__).resolve().parents[3] / "examples" / "shot" / "body.usdc"


@pytest.mark.parametrize("bound", ["own", "mesh"])
def test_hair_of_a_character_that_faces_elsewhere_is_put_on_facing_forward(bound, tmp_path):
    """The file says which way its own head faces; where the hair is not put on another head, it stays as the file shows it."""
    placed = {}
    for angle in (0.0, 60.0, 180.0):
        path = write_shot(tmp_path, Recipe(bound=bound, place=_turned(angle)), f"turned_{angle:g}")
        (groom,), notes = import_groom(path, tmp_path / "on.usda", character=BODY)
        assert [note for note in notes if "off forward" in note] == (
            [
                f"/Hero/Rig: where its hair is, its head faces {angle:.0f} degrees off forward; the hair was turned to face forward"
            ]
            if angle
            else []
        )
        (alone,), _ = import_groom(path, tmp_path / "alone.usda")
        placed[angle] = groom.points, alone.points
    turn = Rotation.from_euler("y", 60.0, degrees=True).as_matrix()
    for angle in (60.0, 180.0):
        assert placed[angle][0] == pytest.approx(placed[0.0][0], abs=1e-4)
    assert placed[60.0][1] == pytest.approx(placed[0.0][1] @ turn.T, abs=1e-4)


def test_an_axis_that_the_file_has_already_changes_nothing(tmp_path):
    path = write_shot(tmp_path, Recipe(place=_turned(90.0)))
    found = [import_groom(path, tmp_path / "on.usda", up=up, character=BODY)[0][0].points for up in (None, "Y")]
    assert np.array_equal(*found)


def test_the_hair_of_one_character_is_taken_as_a_bake_tells_it_from_other_curves(tmp_path):
    """Another character's hair, and grass, would spoil the size of the head."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    (alone,), _ = import_groom(path, tmp_path / "alone.usda", character=BODY)
    stage = Usd.Stage.Open(str(path))
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, "/Hero", layer, "/Other")
    for prim in Usd.PrimRange(stage.GetPrimAtPath("/Other")):
        for relation in prim.GetRelationships():
            relation.SetTargets([each.ReplacePrefix("/Hero", "/Other") for each in relation.GetTargets()])
    UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/Other")).SetTranslate(Gf.Vec3d(1.5, 0, 0))
    Sdf.CopySpec(layer, "/Hero/Hair", layer, "/Grass")
    UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/Grass")).SetTranslate(Gf.Vec3d(0, -1.4, 4))
    stage.Save()
    (found,), notes = import_groom(path, tmp_path / "on.usda", character=BODY)
    assert np.array_equal(found.points, alone.points)
    told = "/Other/Hair: is hair of /Other/Rig, not of /Hero/Rig, so it is left out; name it with --groom"
    assert told in notes and any(note.startswith("/Grass: lies ") and "not taken for hair" in note for note in notes)
    (other,), notes = import_groom(path, tmp_path / "other.usda", character=BODY, grooms=["/Other/Hair"])
    assert other.points == pytest.approx(alone.points, abs=1e-4) and not any("left out" in note for note in notes)
    every, _ = import_groom(path, tmp_path / "every.usda")
    assert len(every) == 3, "where nothing is put on a head, all curves are imported"


def test_curves_are_not_compared_each_with_all_others(tmp_path, monkeypatch):
    """Where a prim holds a single strand, there are thousands."""
    stage, same, asked = Usd.Stage.CreateNew(str(tmp_path / "many.usda")), Usd.Prim.__eq__, []
    for number in range(80):
        curves = UsdGeom.BasisCurves.Define(stage, f"/Hair_{number}")
        curves.CreateCurveVertexCountsAttr([2])
        curves.CreatePointsAttr([(0, number, 0), (1, number, 0)])
    stage.Save()
    monkeypatch.setattr(Usd.Prim, "__eq__", lambda one, other: asked.append(one) or same(one, other))
    assert len(import_groom(tmp_path / "many.usda", tmp_path / "out.usda", unit="cm")[0]) == 80
    assert len(asked) < 10 * 80


def test_what_is_said_to_be_left_out_is_left_out_where_it_is_named(tmp_path):
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Hair", stage.GetRootLayer(), "/Hero/Band")
    band = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Band"))
    band.CreateWrapAttr("periodic")
    stage.Save()
    grooms, notes = import_groom(path, tmp_path / "on.usda", character=BODY, grooms=["/Hero/Hair", "/Hero/Band"])
    assert [groom.name for groom in grooms] == ["/Hero/Hair"]
    assert any(note.startswith("/Hero/Band: its curves are closed") for note in notes)


def test_parts_that_follow_the_head_in_different_ways_stay_together(tmp_path):
    path = write_shot(tmp_path, Recipe(place=_turned(90.0)))
    stage = Usd.Stage.Open(str(path))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Hair", stage.GetRootLayer(), "/Hero/Half")
    stage.Save()
    wanted, _ = import_groom(path, tmp_path / "bound.usda", character=BODY)
    half = stage.GetPrimAtPath("/Hero/Half")
    for name in [name for name in half.GetPropertyNames() if "skel:" in name]:
        half.RemoveProperty(name)
    half.RemoveAppliedSchema("SkelBindingAPI")
    rig = read_shot(path).rigs[0]
    op = UsdGeom.Xformable(half).AddTransformOp()
    above = np.linalg.inv(np.array(UsdGeom.XformCache(1).GetParentToWorldTransform(half)).T)
    for frame in range(1, 10):
        op.Set(
            Gf.Matrix4d(
                (
                    above @ rig.joints_at(frame)[HEAD] @ np.linalg.inv(rig.character.skeleton.bind[HEAD]) @ rig.to_bind
                ).T.tolist()
            ),
            frame,
        )
    stage.Save()
    found, _ = import_groom(path, tmp_path / "on.usda", character=BODY)
    for one, other in zip(found, wanted, strict=True):
        assert one.points == pytest.approx(other.points, abs=1e-3)


def test_prims_are_named_of_usd_files_only(tmp_path):
    (tmp_path / "hair.tfx").write_bytes(b"")
    with pytest.raises(NeuralocksError, match="--groom: only USD files have prims; leave it out"):
        import_groom(tmp_path / "hair.tfx", tmp_path / "out.usda", grooms=["/Hair"])


def _turned(angle: float) -> np.ndarray:
    place = np.eye(4)
    place[:3, :3] = Rotation.from_euler("y", angle, degrees=True).as_matrix()
    return place
