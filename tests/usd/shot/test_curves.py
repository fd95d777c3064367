# SPDX-License-Identifier: Apache-2.0
"""Curves as tools write them, read as grooms."""

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.formats.look import Look
from neuralocks_core.groom import Groom
from neuralocks_core.rest_copy import NAME
from usd.assets.importing import import_groom
from usd.baking.bake import bake
from usd.shot.stage import read_shot
from usd.shot.strands.curves import left_as_they_are, moment, read_groom

from ...core.formats.groom_files import write_hair
from ..shots import Recipe, samples, world_points, write_shot

COUNTS = [2, 3, 2]
POINTS = np.arange(21, dtype=np.float32).reshape(7, 3)
ROOTS = np.array([[0, 0], [0.2, 0.4], [0.5, 1]], np.float32)
EVERY = np.stack([np.arange(7), 2 * np.arange(7)], axis=1).astype(np.float32) / 10


@pytest.mark.parametrize(
    ("interpolation", "kind", "values", "indices", "expected"),
    [
        ("uniform", Sdf.ValueTypeNames.TexCoord2fArray, ROOTS, None, ROOTS),
        ("uniform", Sdf.ValueTypeNames.TexCoord2hArray, ROOTS, [2, 1, 0], ROOTS[::-1]),
        ("vertex", Sdf.ValueTypeNames.TexCoord2fArray, EVERY, None, ROOTS),
        ("constant", Sdf.ValueTypeNames.TexCoord2fArray, ROOTS[1:2], None, ROOTS[[1, 1, 1]]),
        ("vertex", Sdf.ValueTypeNames.TexCoord2fArray, EVERY[:5], None, None),
        ("vertex", Sdf.ValueTypeNames.TexCoord3fArray, np.ones((7, 3), np.float32), None, None),
    ],
)
def test_texture_coordinates_of_roots(interpolation, kind, values, indices, expected):
    stage = Usd.Stage.CreateInMemory()
    curves = UsdGeom.BasisCurves.Define(stage, "/Hair")
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(POINTS))
    curves.CreateCurveVertexCountsAttr(COUNTS)
    primvar = UsdGeom.PrimvarsAPI(curves).CreatePrimvar("st", kind, interpolation)
    primvar.Set([tuple(map(float, row)) for row in values])
    if indices:
        primvar.SetIndices(indices)
    read = read_groom(curves.GetPrim(), np.eye(4), []).root_uv
    assert (read is None) == (expected is None)
    assert expected is None or np.allclose(read, expected, atol=1e-3)


@pytest.mark.parametrize("name", ["widths", "primvars:widths"])
def test_varying_widths_of_cubic_curves_are_those_of_segments_ends(name):
    stage = Usd.Stage.CreateInMemory()
    curves = UsdGeom.BasisCurves.Define(stage, "/Hair")
    curves.CreateTypeAttr("cubic")
    curves.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.arange(33, dtype=np.float32).reshape(11, 3)))
    curves.CreateCurveVertexCountsAttr([4, 7])
    values, notes = {}, []
    for basis, wrap in (("bezier", "nonperiodic"), ("bspline", "nonperiodic"), ("catmullRom", "pinned")):
        curves.CreateBasisAttr(basis)
        curves.CreateWrapAttr(wrap)
        size = curves.ComputeVaryingDataSize(Usd.TimeCode.Default())
        # With thickness that shrinks evenly along each strand, every point gets the value at its place.
        ends = {5: [0, 1, 0, 0.5, 1], 7: [0, 1, 0, 0.25, 0.5, 0.75, 1]}[size]
        attribute = curves.GetPrim().CreateAttribute(name, Sdf.ValueTypeNames.FloatArray)
        attribute.Set((0.001 - 0.0009 * np.array(ends)).tolist())
        UsdGeom.Primvar(attribute).SetInterpolation("varying") if name != "widths" else None
        values[basis] = read_groom(curves.GetPrim(), np.eye(4), notes).widths
    expected = 0.001 - 0.0009 * np.concatenate([np.linspace(0, 1, 4), np.linspace(0, 1, 7)])
    for widths in values.values():
        np.testing.assert_allclose(widths, expected, rtol=1e-5)
    assert not notes
    curves.GetPrim().GetAttribute(name).Set([0.001] * 8)
    read_groom(curves.GetPrim(), np.eye(4), notes)
    assert notes == ["/Hair: 8 widths do not fit 2 strands or are not finite; they are left as they are"]


def test_caches_may_repeat_their_counts_but_not_change_them():
    stage = Usd.Stage.CreateInMemory()
    curves = UsdGeom.BasisCurves.Define(stage, "/Hair")
    for code in (1, 2, *range(4, 50)):
        curves.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(POINTS), code)
        curves.CreateCurveVertexCountsAttr().Set(COUNTS, code)
    assert read_groom(curves.GetPrim(), np.eye(4), []).counts.tolist() == COUNTS
    curves.GetCurveVertexCountsAttr().Set([3, 2, 2], 3)  # in a single sample of many
    with pytest.raises(NeuralocksError, match="/Hair: its curveVertexCounts at time code 3 are not those at rest"):
        read_groom(curves.GetPrim(), np.eye(4), [])


@pytest.mark.parametrize("cache", [False, True])
def test_hair_that_was_exported_live_moves_once(tmp_path, model, cache):
    """The rest points that Blender's live view stored count, not those that it showed, one set or many."""
    recipe = Recipe(bound="none", strands=5, vertices=4)
    plain, live = write_shot(tmp_path, recipe, "plain"), write_shot(tmp_path, recipe, "live")
    stage = Usd.Stage.Open(str(live))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    rest = np.array(curves.GetPointsAttr().Get())
    UsdGeom.PrimvarsAPI(curves).CreatePrimvar(NAME, Sdf.ValueTypeNames.Float3Array, "vertex").Set(
        Vt.Vec3fArray.FromNumpy(rest)
    )
    curves.GetPointsAttr().Clear()
    for code in (1, 2) if cache else (Usd.TimeCode.Default(),):
        curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(rest + np.float32(0.05)), code)
    stage.GetRootLayer().Save()
    bake(plain, tmp_path / "plain_bake.usdc", model)
    notes = bake(live, tmp_path / "live_bake.usdc", model).notes
    assert any("exported from Blender while Live was on" in note for note in notes)
    for frame in (1, 6):
        baked = [world_points(tmp_path / f"{name}_bake.usdc", frame) for name in ("plain", "live")]
        assert np.array_equal(*baked)
    if cache:
        assert np.array_equal(samples(tmp_path / "live_bake.usdc", "points"), rest), "the bake's own default"


@pytest.mark.parametrize(
    ("kept", "counts"),
    [
        (POINTS + 1, True),
        (np.where(np.arange(7)[:, None] == 3, np.float32([-0.0, 0, 0]), POINTS + 1), True),
        (np.where(np.arange(7)[:, None] == 3, np.float32(0), POINTS + 1), False),
        (POINTS[:5] + 1, False),
    ],
    ids=["all", "one at the origin", "one never written", "of other points"],
)
def test_a_rest_shape_that_was_kept_counts_where_it_is_whole(kept, counts):
    stage = Usd.Stage.CreateInMemory()
    curves = UsdGeom.BasisCurves.Define(stage, "/Hair")
    for code in (1, 2):
        curves.CreatePointsAttr().Set(Vt.Vec3fArray.FromNumpy(POINTS), code)
    curves.CreateCurveVertexCountsAttr(COUNTS)
    primvar = UsdGeom.PrimvarsAPI(curves).CreatePrimvar(NAME, Sdf.ValueTypeNames.Float3Array, "vertex")
    primvar.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(kept, np.float32)), 2)
    notes = []
    assert np.array_equal(read_groom(curves.GetPrim(), np.eye(4), notes).points, kept if counts else POINTS)
    assert (moment(curves.GetPrim()) is None) == counts
    assert ("is its shape at rest" if counts else "does not fit its points") in notes[0]


def test_what_groom_readers_know_is_written_and_goes_on(tmp_path):
    """Root UVs and widths even if a file has none; colours, numbers and guides of other tools unchanged."""
    source = write_shot(tmp_path, Recipe(bound="none", strands=5, vertices=4), "source")
    stage = Usd.Stage.Open(str(source))
    prim = stage.GetPrimAtPath("/Hero/Hair")
    api, names = UsdGeom.PrimvarsAPI(prim), Sdf.ValueTypeNames
    told = {
        "groom_id": (names.IntArray, "uniform", 1, [70, 71, 72, 73, 74]),
        "groom_closest_guides": (names.IntArray, "uniform", 3, list(range(15))),
        "groom_color": (names.Float3Array, "vertex", 1, [(0.1, 0.2, 0.3 + i) for i in range(20)]),
        "groom_sway": (names.FloatArray, "varying", 1, [0.5 + i for i in range(20)]),
        "displayColor": (names.Color3fArray, "varying", 1, [(0.1, 0.2, 0.01 * i) for i in range(20)]),
        "groom_unfit": (names.IntArray, "uniform", 1, [1, 2]),
    }
    for name, (kind, scope, size, value) in told.items():
        api.CreatePrimvar(name, kind, scope, size).Set(value)
    stage.GetRootLayer().Save()
    _, notes = import_groom(source, tmp_path / "groom.usda")
    assert notes == ["/Hero/Hair: primvars:groom_unfit (uniform) does not fit 5 strands of 20 points; left out"]
    groom = Usd.Stage.Open(str(tmp_path / "groom.usda"))
    written = UsdGeom.PrimvarsAPI(groom.GetPrimAtPath("/Groom/Hair"))
    told.pop("groom_unfit")
    for name, (kind, scope, size, value) in told.items():
        primvar = written.GetPrimvar(name)
        assert (primvar.GetTypeName(), primvar.GetInterpolation(), primvar.GetElementSize()) == (kind, scope, size)
        assert np.allclose(np.array(primvar.Get()), value)
    assert not written.GetPrimvar("groom_unfit")
    uv = np.array(written.GetPrimvar("groom_root_uv").Get())
    assert uv.shape == (5, 2) and len(np.unique(uv, axis=0)) == 5 and 0 <= uv.min() and uv.max() <= 1
    assert written.GetPrimvar("groom_width").Get()[0] == pytest.approx(0.01), "0.1 mm, in centimetres"


@pytest.mark.parametrize(
    ("basis", "each", "fits"),
    [("bezier", 3, True), ("catmullRom", 5, True), ("catmullRom", 7, True), ("bspline", 4, False)],
)
def test_varying_values_go_on_with_their_spline(tmp_path, basis, each, fits):
    """One for each end of a segment; for pinned curves, also as many as points."""
    source = write_shot(tmp_path, Recipe(bound="none", strands=4, vertices=7, basis=basis), "source")
    stage = Usd.Stage.Open(str(source))
    values = [0.5 * i for i in range(4 * each)]
    api = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Hero/Hair"))
    api.CreatePrimvar("groom_sway", Sdf.ValueTypeNames.FloatArray, "varying").Set(values)
    stage.Save()
    _, notes = import_groom(source, tmp_path / "groom.usda")
    groom = Usd.Stage.Open(str(tmp_path / "groom.usda"))
    primvar = UsdGeom.PrimvarsAPI(groom.GetPrimAtPath("/Groom/Hair")).GetPrimvar("groom_sway")
    if fits:
        assert (primvar.GetInterpolation(), list(primvar.Get())) == ("varying", values) and not notes
    else:
        assert not primvar and "groom_sway (varying) does not fit" in notes[0]


@pytest.mark.parametrize(("rows", "scope"), [(1, "constant"), (12, "vertex")])
def test_colors_of_a_hair_file_are_shown(tmp_path, rows, scope):
    rng = np.random.default_rng(0)
    look = Look(rng.uniform(0.1, 1, (rows, 3)).astype(np.float32), rng.uniform(0, 0.9, rows).astype(np.float32))
    hair = Groom("Hair", 0.1 * rng.normal(size=(12, 3)), [4, 8])
    write_hair(tmp_path / "hair.hair", hair, look=look)
    import_groom(tmp_path / "hair.hair", tmp_path / "groom.usda")
    import_groom(tmp_path / "groom.usda", tmp_path / "again.usda")
    for name in ("groom.usda", "again.usda"):
        stage = Usd.Stage.Open(str(tmp_path / name))
        curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Groom/hair"))
        for primvar, values in (
            (curves.GetDisplayColorPrimvar(), look.color),
            (curves.GetDisplayOpacityPrimvar(), look.opacity),
        ):
            assert primvar.GetInterpolation() == scope
            np.testing.assert_allclose(np.array(primvar.Get()), values, atol=1e-6)


def test_a_hair_file_without_colors_gets_none(tmp_path):
    write_hair(tmp_path / "hair.hair", Groom("hair", 0.1 * np.eye(3), [3]))
    import_groom(tmp_path / "hair.hair", tmp_path / "groom.usda")
    stage = Usd.Stage.Open(str(tmp_path / "groom.usda"))
    curves = UsdGeom.Gprim(stage.GetPrimAtPath("/Groom/hair"))
    assert not curves.GetDisplayColorAttr().HasAuthoredValue() and not curves.GetDisplayOpacityAttr().HasAuthoredValue()


@pytest.mark.parametrize("name", ["normals", "primvars:normals"])
def test_normals_are_said_to_stay_behind(name):
    stage = Usd.Stage.CreateInMemory()
    curves = UsdGeom.BasisCurves.Define(stage, "/Ribbons")
    assert left_as_they_are(curves.GetPrim()) == []
    curves.GetPrim().CreateAttribute(name, Sdf.ValueTypeNames.Normal3fArray).Set([(0, 0, 1)])
    assert left_as_they_are(curves.GetPrim())[0].startswith("/Ribbons: has normals")


def test_a_cache_that_begins_with_its_default_points_is_told(tmp_path, still_model):
    """As Blender 5 exports hair that plays a cache. A bake of ours has its groom as default, wherever it begins."""
    path = write_shot(tmp_path, Recipe(frames=3))
    told = "/Hero/Hair: its points change, and begin with those at the default time"

    def notes(shot) -> list[str]:
        return [note for note in read_shot(shot).notes if note.startswith(told)]

    bake(path, tmp_path / "bake.usdc", still_model)
    assert not notes(path) and not notes(tmp_path / "bake.usdc")
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    rest = np.array(points.Get())
    for code, moved in ((1, 0.0), (2, 0.01)):
        points.Set(Vt.Vec3fArray.FromNumpy(rest + np.float32(moved)), code)
    stage.Save()
    assert len(notes(path)) == 1
    points.Set(Vt.Vec3fArray.FromNumpy(rest + np.float32(0.02)))
    stage.Save()
    assert not notes(path)
