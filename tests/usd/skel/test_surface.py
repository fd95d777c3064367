# SPDX-License-Identifier: Apache-2.0
"""Bindings and bodies as UsdSkel has them, wherever they are authored."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.review.baked import read_baked
from usd.review.inspect import inspect
from usd.shot.stage import read_rigs, read_shot
from usd.shot.strands.curves import rest_points
from usd.skel.binding import bound_skeleton

from ..shots import CENTRE, HEAD, JOINTS, RIG, Recipe, samples, write_shot


def test_a_binding_above_a_groom_counts_as_usd_skel_counts_it(tmp_path, still_model):
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    place = Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 2, 3), 40)) * Gf.Matrix4d().SetTranslate((0.3, 0.1, 0.2))
    above = UsdSkel.BindingAPI.Apply(UsdGeom.Xform.Define(stage, "/Hero/Groom").GetPrim())
    above.CreateSkeletonRel().SetTargets(["/Hero/Rig"])
    above.CreateGeomBindTransformAttr(place)
    above.CreateJointsAttr([JOINTS[HEAD]])
    above.CreateJointIndicesPrimvar(True, 1).Set(Vt.IntArray([0]))
    above.CreateJointWeightsPrimvar(True, 1).Set(Vt.FloatArray([1.0]))
    # An attribute on a prim without a binding does not count.
    beside = UsdGeom.Xform.Define(stage, "/Hero/Groom/Left").GetPrim()
    beside.CreateAttribute("primvars:skel:geomBindTransform", above.GetGeomBindTransformAttr().GetTypeName()).Set(
        Gf.Matrix4d(2)
    )
    hair = UsdGeom.BasisCurves.Define(stage, "/Hero/Groom/Left/Hair")
    old = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    hair.CreatePointsAttr([Gf.Vec3f(place.GetInverse().Transform(Gf.Vec3d(p))) for p in old.GetPointsAttr().Get()])
    hair.CreateCurveVertexCountsAttr(old.GetCurveVertexCountsAttr().Get())
    UsdSkel.BindingAPI.Apply(hair.GetPrim())
    stage.RemovePrim("/Hero/Hair")
    stage.Save()
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(stage.GetPrimAtPath("/Hero")), Usd.PrimDefaultPredicate)
    skinning = cache.GetSkinningQuery(hair.GetPrim())
    (item,) = read_shot(path).grooms
    assert item.joint == JOINTS[HEAD] == skinning.GetJointOrder()[0]
    expected = [skinning.GetGeomBindTransform().Transform(Gf.Vec3d(*map(float, p))) for p in rest_points(item.prim)]
    np.testing.assert_allclose(item.groom.points, expected, atol=1e-6)
    # Unbinding the hair leaves the group's binding, which readers of the bake must handle.
    (again,) = read_shot(bake(path, tmp_path / "hair.usdc", still_model, frames="1:2").path).grooms
    assert (again.joint, bound_skeleton(again.prim)) == (item.joint, RIG)
    np.testing.assert_array_equal(again.groom.points, item.groom.points)
    hair.GetPrim().GetRelationship("skel:skeleton").SetTargets([])
    stage.Save()
    assert bound_skeleton(read_shot(path, ["/Hero/Groom"]).grooms[0].prim) is None


@pytest.mark.parametrize("way", ["flattened", "referenced", "rebaked"])
def test_a_bake_that_is_flattened_or_referenced_still_tells_the_binding_of_its_hair(tmp_path, still_model, way):
    """The binding leads to the bind pose by another transform than the place in the stage."""
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    place = Gf.Matrix4d().SetRotate(Gf.Rotation((1, 2, 3), 40)) * Gf.Matrix4d().SetTranslate((3, 1, 2))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    points.Set([Gf.Vec3f(place.GetInverse().Transform(Gf.Vec3d(point))) for point in points.Get()])
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Hero/Hair")).GetGeomBindTransformAttr().Set(place)
    stage.Save()
    (before,) = read_shot(path).grooms
    made = bake(path, tmp_path / "hair.usdc", still_model, frames="1:3").path
    copy = tmp_path / "copy.usda"
    if way == "referenced":
        above = Usd.Stage.CreateNew(str(copy))
        UsdGeom.SetStageMetersPerUnit(above, 1)
        UsdGeom.SetStageUpAxis(above, "Y")
        above.DefinePrim("/Cast/Her").GetReferences().AddReference(str(made))
        above.Save()
    else:
        Usd.Stage.Open(str(made)).Export(str(copy))
        copy = bake(copy, tmp_path / "again.usdc", still_model, frames="1:3").path if way == "rebaked" else copy
    (item,) = read_baked(copy).shot.grooms
    assert (item.joint, bound_skeleton(item.prim)) == (before.joint, item.attachment.rig.path)
    np.testing.assert_allclose(item.groom.points, before.groom.points, atol=1e-6)


@pytest.mark.parametrize("way", ["references", "inherits"])
def test_baked_hair_that_is_used_twice_is_on_each_character(tmp_path, still_model, way):
    """The skeleton that a bake unbound it from is that of the same copy, also where the first copy is on the stage as well."""
    made = bake(write_shot(tmp_path), tmp_path / "hair.usdc", still_model, frames="1:3").path
    stage = Usd.Stage.CreateNew(str(tmp_path / "crowd.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    UsdGeom.SetStageUpAxis(stage, "Y")
    if way == "inherits":
        stage.CreateClassPrim("/Hero").GetReferences().AddReference(str(made), "/Hero")
    for name, x in (("Hero" if way == "references" else "First", 0), ("Second", 3)):
        prim = stage.DefinePrim(f"/{name}")
        if way == "references":
            prim.GetReferences().AddReference(str(made), "/Hero")
        else:
            prim.GetInherits().AddInherit("/Hero")
        UsdGeom.Xformable(prim).AddTranslateOp().Set((x, 0, 0))
    stage.Save()
    grooms = read_baked(tmp_path / "crowd.usda").shot.grooms
    assert [each.attachment.rig.path.split("/")[1] for each in grooms] == [each.path.split("/")[1] for each in grooms]
    np.testing.assert_allclose(grooms[1].groom.points, grooms[0].groom.points, atol=1e-6)


def test_a_mesh_that_is_hidden_while_others_are_seen_is_told(tmp_path):
    """A hat that is put on, but not a character that comes into the shot."""
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    Sdf.CopySpec(stage.GetRootLayer(), "/Hero/Skin", stage.GetRootLayer(), "/Hero/Hat")
    told = [note for note in read_rigs(path)[0].notes if "hidden at times" in note]
    for name in ("/Hero", "/Hero/Hat"):
        switch = UsdGeom.Imageable(stage.GetPrimAtPath(name)).CreateVisibilityAttr()
        switch.Set("invisible", 1)
        switch.Set("inherited", 5 if name == "/Hero" else 7)
        stage.Save()
        told.append([note for note in read_rigs(path)[0].notes if "hidden at times" in note])
    assert told[0] == [] and told[1][0].startswith(
        "/Hero/Hat: hidden at times, but hair is kept out of it in all frames"
    )


def test_a_character_that_comes_into_sight_has_its_body_before(tmp_path):
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    switch = UsdGeom.Imageable(stage.GetPrimAtPath("/Hero")).CreateVisibilityAttr()
    switch.Set("invisible", 1)
    switch.Set("inherited", 5)
    stage.Save()
    assert read_rigs(path)[0].character.body is not None
    # Never visible: while the mesh is shown, its parent is hidden.
    mesh = UsdGeom.Imageable(stage.GetPrimAtPath("/Hero/Skin")).CreateVisibilityAttr()
    mesh.Set("inherited", 1)
    mesh.Set("invisible", 5)
    stage.Save()
    assert read_rigs(path)[0].character.body is None


def test_a_body_that_usd_leaves_where_it_was_made_is_told(tmp_path):
    def told(path):
        found = [
            [note for note in notes if "SkelRoot" in note] for notes in (read_shot(path).notes, inspect(path)["spoils"])
        ]
        assert found[0] == found[1]
        return found[0]

    character = write_shot(tmp_path, Recipe(bound="mesh"))
    assert told(character) == []
    (note,) = told(write_shot(tmp_path, Recipe(skel_root=False), "bare"))
    assert note.startswith("/Hero/Rig: no SkelRoot is above /Hero/Skin,") and note.endswith("; make /Hero a SkelRoot")
    for name, there, named, remedy in (
        ("teeth", "/Hero/Teeth", "/Hero/Skin and 1 more", "make /Hero a SkelRoot"),
        ("apart", "/Skin", "/Skin", "put both below a SkelRoot"),
    ):
        layer = Sdf.Layer.FindOrOpen(str(write_shot(tmp_path, Recipe(skel_root=False), name)))
        Sdf.CopySpec(layer, "/Hero/Skin", layer, there)
        if named == there:
            del layer.GetPrimAtPath("/Hero").nameChildren["Skin"]
        layer.Save()
        (note,) = told(layer.realPath)
        assert f" is above {named}, " in note and note.endswith(f"; {remedy}")
    stage = Usd.Stage.Open(str(write_shot(tmp_path, Recipe(bound="mesh"), "unapplied")))
    stage.GetPrimAtPath("/Hero/Skin").RemoveAPI(UsdSkel.BindingAPI)
    stage.Save()
    (note,) = (note for note in read_shot(tmp_path / "unapplied.usda").notes if "SkelBindingAPI" in note)
    assert note.startswith("/Hero/Rig: SkelBindingAPI is not applied to /Hero/Skin, so USD draws it as modelled")
    # A reference on a prim with its own type, which is stronger than the SkelRoot's.
    stage = Usd.Stage.CreateNew(str(tmp_path / "set.usda"))
    for name, kind in (("Left", UsdGeom.Xform), ("Right", UsdSkel.Root)):
        kind.Define(stage, f"/Set/{name}").GetPrim().GetReferences().AddReference("./shot.usda", "/Hero")
    stage.GetPrimAtPath("/Set/Left").SetInstanceable(True)
    stage.Save()
    (note,) = told(tmp_path / "set.usda")
    assert note.startswith("/Set/Left/Rig: ")
    assert note.endswith("; /Set/Left is one below a stronger opinion that types it Xform: type it SkelRoot there")


@pytest.mark.parametrize("above", [False, True])
@pytest.mark.parametrize("method", ["dualQuaternion", "classicLinear"])
def test_a_body_that_is_not_posed_as_its_mesh_asks_is_told(tmp_path, method, above):
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/Hero" if above else "/Hero/Skin")
    UsdSkel.BindingAPI.Apply(prim).CreateSkinningMethodAttr(method)
    stage.Save()
    for notes in (read_shot(path).notes, inspect(path)["spoils"]):
        told = [note for note in notes if note.startswith("/Hero/Skin: its skinningMethod is dualQuaternion")]
        assert len(told) == (method == "dualQuaternion")


def test_hair_that_is_bound_mirrored_is_the_hair_that_it_shows(tmp_path, model):
    """As the other half of a symmetric hairdo is bound: its points, widths and motion are those of hair without a mirror."""
    path = write_shot(tmp_path, Recipe(strands=6, vertices=5))
    stage = Usd.Stage.Open(str(path))
    stage.GetPrimAtPath("/Hero/Hair").GetAttribute("widths").Set([0.02])
    stage.Save()
    plain = bake(path, tmp_path / "plain.usdc", model)
    (before,) = read_shot(path).grooms
    hair, place = stage.GetPrimAtPath("/Hero/Hair"), Gf.Matrix4d().SetScale((-0.5, 0.5, 0.5))
    curves = UsdGeom.BasisCurves(hair)
    curves.GetPointsAttr().Set(
        [Gf.Vec3f(place.GetInverse().Transform(Gf.Vec3d(p))) for p in curves.GetPointsAttr().Get()]
    )
    curves.GetWidthsAttr().Set([2 * width for width in curves.GetWidthsAttr().Get()])
    UsdSkel.BindingAPI(hair).GetGeomBindTransformAttr().Set(place)
    stage.Save()
    (item,) = read_shot(path).grooms
    np.testing.assert_allclose(item.groom.points, before.groom.points, atol=1e-6)
    np.testing.assert_allclose(item.groom.widths, before.groom.widths, rtol=1e-6)
    mirrored = bake(path, tmp_path / "mirrored.usdc", model)
    for code in (1, 5, 9):
        for name, near in (("points", 1e-5), ("velocities", 1e-3)):
            shown, expected = (samples(out.path, name, at=code) for out in (mirrored, plain))
            np.testing.assert_allclose(shown, expected, atol=near)
        points, extent = samples(mirrored.path, "points", "extent", at=code)  # no binding scales widths
        np.testing.assert_allclose(extent, [points.min(axis=0) - 0.02, points.max(axis=0) + 0.02], atol=1e-6)


def test_hair_below_a_mirror_has_its_own_points_where_it_rests(tmp_path, model):
    path = write_shot(tmp_path, Recipe(bound="mesh", strands=6, vertices=5))
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    curves.AddScaleOp().Set((-0.7, 0.7, 0.7))
    rest = np.asarray(curves.GetPointsAttr().Get()) / np.float32([-0.7, 0.7, 0.7])
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(rest))
    stage.Save()
    out = bake(path, tmp_path / "out.usdc", model, frames="1:5").path
    np.testing.assert_array_equal(samples(out, "points", at=1), rest)
    assert np.abs(samples(out, "points", at=5) - rest).max() > 0.01


@pytest.mark.parametrize("mirrored", [False, True])
def test_an_open_mesh_of_left_handed_faces_faces_outward(tmp_path, still_model, mirrored):
    """Unlike a ball's, its shape does not tell its sides: hair must be pushed out of it, not through."""
    path = write_shot(tmp_path, Recipe(bound="mesh", strands=20))
    stage = Usd.Stage.Open(str(path))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin"))
    points = np.asarray(mesh.GetPointsAttr().Get())
    corners = np.asarray(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 4)
    cap = corners[(points[corners][..., 1] > CENTRE[1] + 0.07).all(axis=1)]
    mesh.GetFaceVertexCountsAttr().Set([4] * len(cap))
    mesh.GetFaceVertexIndicesAttr().Set(cap.ravel().tolist())
    stage.Save()
    right = read_rigs(path)[0].character.body
    if mirrored:  # by its binding, which flips faces once more
        place = Gf.Matrix4d().SetScale((-1, 1, 1))
        mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy((points * [-1, 1, 1]).astype(np.float32)))
        UsdSkel.BindingAPI(mesh).GetGeomBindTransformAttr().Set(place)
    else:
        mesh.GetFaceVertexIndicesAttr().Set(cap[:, ::-1].ravel().tolist())
    mesh.CreateOrientationAttr("leftHanded")
    stage.Save()
    (rig,) = read_rigs(path)
    assert not any("inside out" in note for note in rig.notes)
    for body in (right, rig.character.body):
        a, b, c = (body.points[body.triangles[:, corner]] for corner in range(3))
        assert (np.cross(b - a, c - a)[:, 1] > -1e-9).all() and (np.cross(b - a, c - a)[:, 1] > 1e-6).any()


@pytest.mark.parametrize("swollen", [0.0, 1e-7, 0.03])
def test_a_body_whose_points_move_before_skinning_is_told(tmp_path, swollen):
    """Hair is kept out of the points at rest; some exporters write the same points in each frame."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin")).GetPointsAttr()
    rest = np.array(points.Get())
    for code in (1, 5, 9):
        points.Set(Vt.Vec3fArray.FromNumpy((rest * (1 + swollen * (code - 1))).astype(np.float32)), code)
    stage.Save()
    said = [note for note in read_shot(path).notes if "move before skinning" in note]
    assert [note.startswith("/Hero/Skin: ") for note in said] == [True] * (swollen > 1e-3)


def test_a_body_whose_points_are_not_finite_is_refused_without_a_warning(tmp_path):
    """Also if they are samples."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/Hero/Skin")).GetPointsAttr()
    broken = np.array(points.Get())
    broken[0] = np.inf
    for code in (Usd.TimeCode.Default(), 1):
        points.Set(Vt.Vec3fArray.FromNumpy(broken), code)
    stage.Save()
    with pytest.raises(NeuralocksError, match="/Hero/Skin: the mesh's points hold NaN or infinity"):
        read_shot(path)
