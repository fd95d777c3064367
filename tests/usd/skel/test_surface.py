# SPDX-License-Identifier: Apache-2.0
"""Bindings and bodies as UsdSkel has them, wherever they are authored."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel, Vt

from usd.baking.bake import bake
from usd.review.baked import read_baked
from usd.review.inspect import inspect
from usd.shot.curves import rest_points
from usd.shot.stage import read_rigs, read_shot
from usd.skel.surface import bound_skeleton

from ..shots import HEAD, JOINTS, Recipe, write_shot


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
    # An attribute on a prim without a binding is none.
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
    # What unbinds the hair leaves the group's binding, of which whoever reads the bake must know.
    (again,) = read_shot(bake(path, tmp_path / "hair.usdc", still_model, frames="1:2").path).grooms
    assert (again.joint, again.attachment.skinned) == (item.joint, True)
    np.testing.assert_array_equal(again.groom.points, item.groom.points)
    hair.GetPrim().GetRelationship("skel:skeleton").SetTargets([])
    stage.Save()
    assert bound_skeleton(read_shot(path, ["/Hero/Groom"]).grooms[0].prim) is None


@pytest.mark.parametrize("way", ["flattened", "referenced", "rebaked"])
def test_a_bake_that_is_flattened_or_referenced_still_tells_the_binding_of_its_hair(tmp_path, still_model, way):
    """That leads to the bind pose another way than the place in the stage."""
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
    assert (item.joint, item.attachment.skinned) == (before.joint, True)
    np.testing.assert_allclose(item.groom.points, before.groom.points, atol=1e-6)


def test_a_character_that_comes_into_sight_has_its_body_before(tmp_path):
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    switch = UsdGeom.Imageable(stage.GetPrimAtPath("/Hero")).CreateVisibilityAttr()
    switch.Set("invisible", 1)
    switch.Set("inherited", 5)
    stage.Save()
    assert read_rigs(path)[0].character.body is not None
    # Never in sight at one time: while the mesh is shown, what it lies below is hidden.
    mesh = UsdGeom.Imageable(stage.GetPrimAtPath("/Hero/Skin")).CreateVisibilityAttr()
    mesh.Set("inherited", 1)
    mesh.Set("invisible", 5)
    stage.Save()
    assert read_rigs(path)[0].character.body is None


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
