# SPDX-License-Identifier: Apache-2.0
"""What is kept with the strands of curves that are imported from USD."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdShade

from usd.assets.importing import import_groom

from ..shots import Recipe, write_shot


@pytest.fixture
def imported(tmp_path):
    """Imports a shot whose stage a function has changed; returns the curves' prim, its stage and the notes."""

    def make(change):
        source = write_shot(tmp_path, Recipe(bound="own", strands=3, vertices=4, unit=0.01, up="Z"))
        stage = Usd.Stage.Open(str(source))
        change(stage)
        stage.GetRootLayer().Save()
        _, notes = import_groom(source, tmp_path / "groom.usda")
        new = Usd.Stage.Open(str(tmp_path / "groom.usda"))
        return new.GetPrimAtPath("/Groom/Hair"), new, notes

    return make


def test_purpose_and_visibility_go_on_also_those_of_the_prims_above(imported):
    def change(stage):
        UsdGeom.Imageable(stage.GetPrimAtPath("/Hero")).CreatePurposeAttr("render")
        UsdGeom.Imageable(stage.GetPrimAtPath("/Hero")).MakeInvisible()

    prim, _stage, notes = imported(change)
    assert UsdGeom.Imageable(prim).ComputePurpose() == "render" and not notes
    assert UsdGeom.Imageable(prim).ComputeVisibility() == UsdGeom.Tokens.invisible


@pytest.mark.parametrize("switched", [False, True])
def test_what_is_shown_at_some_time_is_shown(imported, switched):
    """And curves without purpose and visibility stay without them."""

    def change(stage):
        if switched:
            seen = UsdGeom.Imageable(stage.GetPrimAtPath("/Hero/Hair")).CreateVisibilityAttr()
            seen.Set("invisible", 1)
            seen.Set("inherited", 3)

    prim, _stage, notes = imported(change)
    shown = UsdGeom.Imageable(prim)
    assert not shown.GetPurposeAttr().HasAuthoredValue() and not shown.GetVisibilityAttr().HasAuthoredValue()
    assert not notes


_NAMES = Sdf.ValueTypeNames
_GIVEN = [
    ("groom_guide", _NAMES.BoolArray, "uniform", [True, False, False]),
    ("groom_group_id", _NAMES.Int, "constant", 4),
    ("groom_id", _NAMES.Int64Array, "uniform", [7, 8, 9]),
    ("st", _NAMES.TexCoord2f, "constant", (0.5, 0.25)),
    ("st", _NAMES.TexCoord3fArray, "uniform", [(0.5, 0.25, 0)] * 3),
]


@pytest.mark.parametrize("name, kind, interpolation, value", _GIVEN)
def test_what_an_import_writes_itself_keeps_the_type_that_it_had(imported, name, kind, interpolation, value):
    def change(stage):
        api = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Hero/Hair"))
        api.CreatePrimvar(name, kind, interpolation).Set(value)

    prim, _stage, _notes = imported(change)
    primvar = UsdGeom.PrimvarsAPI(prim).GetPrimvar(name)
    assert (primvar.GetTypeName(), primvar.GetInterpolation()) == (kind, interpolation)
    np.testing.assert_array_equal(primvar.Get(), value)


def test_constant_primvars_of_the_prims_above_go_on(imported):
    """As renderers read them: the nearest counts, and only constant ones are inherited."""
    names = Sdf.ValueTypeNames

    def change(stage):
        above = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Hero"))
        above.CreatePrimvar("displayColor", names.Color3fArray, "constant").Set([(0.5, 0.25, 0.125)])
        above.CreatePrimvar("look", names.String, "constant").Set("above")
        above.CreatePrimvar("speckle", names.FloatArray, "uniform").Set([1, 2, 3])
        own = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Hero/Hair"))
        own.CreatePrimvar("look", names.String, "constant").Set("own")
        own.CreatePrimvar("clump", names.IntArray, "uniform").Set([7, 8, 9])
        own.CreatePrimvar("melanin", names.FloatArray, "vertex").Set(np.linspace(0, 1, 12).tolist())
        own.CreatePrimvar("wet", names.FloatArray, "faceVarying").Set(np.linspace(1, 2, 12).tolist())

    prim, _stage, notes = imported(change)
    api = UsdGeom.PrimvarsAPI(prim)
    color = api.GetPrimvar("displayColor")
    assert (color.GetInterpolation(), list(color.Get())) == ("constant", [(0.5, 0.25, 0.125)])
    assert api.GetPrimvar("look").Get() == "own" and not api.GetPrimvar("speckle")
    assert (api.GetPrimvar("clump").GetInterpolation(), list(api.GetPrimvar("clump").Get())) == ("uniform", [7, 8, 9])
    assert np.allclose(np.array(api.GetPrimvar("melanin").Get()), np.linspace(0, 1, 12)) and not notes
    assert api.GetPrimvar("wet").GetInterpolation() == "faceVarying" and len(api.GetPrimvar("wet").Get()) == 12
    assert not any(primvar.GetPrimvarName().startswith("skel:") for primvar in api.GetPrimvars())


def test_what_does_not_go_on_is_told(imported):
    """Positions in another unit and axis, file names, and what shades the hair."""
    names = Sdf.ValueTypeNames

    def change(stage):
        own = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Hero/Hair"))
        own.CreatePrimvar("Pref", names.Point3fArray, "vertex").Set([(0, 0, 1)] * 12)
        own.CreatePrimvar("map", names.Asset, "constant").Set("./map.png")
        own.CreatePrimvar("few", names.FloatArray, "uniform").Set([1])
        material = UsdShade.Material.Define(stage, "/Hero/Brown")
        UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/Hero")).Bind(material)

    prim, stage, notes = imported(change)
    assert sorted(notes) == [
        "/Hero/Hair: its material /Hero/Brown is not imported; bind one to the new groom",
        "/Hero/Hair: primvars:Pref (point3f[]) is in the space of its own file; left out",
        "/Hero/Hair: primvars:few (uniform) does not fit 3 strands of 12 points; left out",
        "/Hero/Hair: primvars:map names files, whose paths may not resolve from elsewhere; left out",
    ]
    assert not any(UsdGeom.PrimvarsAPI(prim).HasPrimvar(name) for name in ("Pref", "map", "few"))


def test_attributes_of_other_tools_and_what_changes_are_told(imported):
    names = Sdf.ValueTypeNames

    def change(stage):
        prim = stage.GetPrimAtPath("/Hero/Hair")
        wet = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("wet", names.Float, "constant").GetAttr()
        for code in (1, 2):
            wet.Set(0.5 * code, code)
        for name in ("hair:guide_id", "userProperties:blender:data_name"):
            prim.CreateAttribute(name, names.Int).Set(3)

    prim, _, notes = imported(change)
    assert sorted(notes) == [
        "/Hero/Hair: hair:guide_id left out; only primvars are imported, make them primvars",
        "/Hero/Hair: primvars:wet changes over time; its first values are imported",
    ]
    assert UsdGeom.PrimvarsAPI(prim).GetPrimvar("wet").Get() == 0.5


@pytest.mark.parametrize("unit, centimetres", [(None, 0.01), ("mm", 0.001)])
def test_the_width_that_other_tools_read_is_that_of_the_hair_as_imported(tmp_path, unit, centimetres):
    """An import writes it, so a groom that was imported before has one already."""
    first, second = tmp_path / "first.usda", tmp_path / "second.usda"
    import_groom(write_shot(tmp_path, Recipe(unit=0.01)), first)
    stage = Usd.Stage.Open(str(first))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.Xformable(stage.GetPrimAtPath("/Groom")).AddScaleOp().Set((100, 100, 100))
    stage.GetRootLayer().Save()
    import_groom(first, second, unit)
    stage = Usd.Stage.Open(str(second))
    hair = stage.GetPrimAtPath("/Groom/Hair")
    width = UsdGeom.PrimvarsAPI(hair).GetPrimvar("groom_width").Get()
    np.testing.assert_allclose(width, centimetres, rtol=1e-5)
    np.testing.assert_allclose(width, 100 * np.array(UsdGeom.BasisCurves(hair).GetWidthsAttr().Get()), rtol=1e-6)


def test_empty_and_closed_curves_beside_the_hair_are_left_out(imported):
    """As exporters leave them behind: a prim without points, and a rig's controls."""

    def change(stage):
        layer = stage.GetRootLayer()
        Sdf.CopySpec(layer, "/Hero/Hair", layer, "/Hero/Control")
        UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Control")).CreateWrapAttr("periodic")
        UsdGeom.BasisCurves.Define(stage, "/Hero/Empty").CreatePointsAttr([])

    prim, stage, notes = imported(change)
    assert prim and len([each for each in stage.Traverse() if each.IsA(UsdGeom.BasisCurves)]) == 1
    assert sorted(notes) == [
        "/Hero/Control: its curves are closed, as a rig's controls are; left out: set their wrap to pinned if they are hair",
        "/Hero/Empty: the curves have no points; left out",
    ]
