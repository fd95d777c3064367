# SPDX-License-Identifier: Apache-2.0
"""The top of an override layer: opened instead of the shot, it must show all of it."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from usd.baking.bake import bake
from usd.baking.layer.header import write_header
from usd.border.stage_files import used_files
from usd.border.units import Border
from usd.review.baked import read_baked
from usd.review.inspect import inspect
from usd.shot.stage import read_shot
from usd.skel.binding import bound_skeleton

from ..shots import Recipe, samples, write_shot

SHOT = """#usda 1.0
(
    colorConfiguration = @./show.ocio@
    customLayerData = { asset plate = @../plates/a.exr@ }
    defaultPrim = "Hero"
    expressionVariables = { string CHARACTER = "hero" }
    metersPerUnit = 0.01
    owner = "layout"
    renderSettingsPrimPath = "/Render/main"
    upAxis = "Z"
)
def "Hero" (references = @`"./${CHARACTER}.usda"`@)
{
}
"""


def _header(shot, out):
    stage = Usd.Stage.Open(str(shot))
    layer = Sdf.Layer.CreateNew(str(out))
    write_header(layer, stage, Border.of(stage), shot, out, [1.0])
    layer.Save()
    return layer


@pytest.fixture
def shot(tmp_path):
    """A shot whose root layer states what its references need."""
    folder = tmp_path / "show" / "shots"
    folder.mkdir(parents=True)
    (folder / "hero.usda").write_text('#usda 1.0\n(defaultPrim = "Hero")\ndef Xform "Hero" {\n  def "Hair" {\n}\n}\n')
    (folder / "shot.usda").write_text(SHOT)
    return folder / "shot.usda"


def test_what_usd_reads_of_the_first_layer_only_is_repeated(shot, tmp_path):
    (tmp_path / "cache").mkdir()
    layer = _header(shot, tmp_path / "cache" / "hair.usda")
    stage = Usd.Stage.Open(layer)
    assert stage.GetPrimAtPath("/Hero/Hair") and not stage.GetCompositionErrors()
    assert stage.GetMetadata("renderSettingsPrimPath") == "/Render/main"
    assert layer.colorConfiguration.path == "../show/shots/show.ocio"
    assert layer.customLayerData["plate"].path == "../show/plates/a.exr"
    assert not layer.owner and list(layer.subLayerPaths) == ["../show/shots/shot.usda"]


def test_a_default_prim_below_another_is_repeated(shot, tmp_path):
    shot.write_text('#usda 1.0\n(defaultPrim = "/World/Hero")\ndef "World" {\n  def "Hero" {\n}\n}\n')
    assert str(Usd.Stage.Open(_header(shot, tmp_path / "hair.usda")).GetDefaultPrim().GetPath()) == "/World/Hero"


def test_every_process_writes_the_same_bytes(shot, tmp_path):
    code = "import sys; from pathlib import Path; from tests.usd.baking.test_override import _header; _header(*map(Path, sys.argv[1:]))"
    written = []
    for number in range(3):
        out = tmp_path / str(number) / "hair.usdc"
        out.parent.mkdir()
        subprocess.run([sys.executable, "-c", code, str(shot), str(out)], check=True, cwd=Path(__file__).parents[3])
        written.append(out.read_bytes())
    assert written[0] == written[1] == written[2]


def test_a_shot_behind_a_link_is_named_as_it_was_given(shot, tmp_path):
    # A store of files by content: names without meaning or extension, and nothing beside them.
    (tmp_path / "store").mkdir()
    os.rename(shot, tmp_path / "store" / "5f3a")
    shot.symlink_to(tmp_path / "store" / "5f3a")
    stage = Usd.Stage.Open(_header(shot, shot.parent / "hair.usda"))
    assert stage.GetPrimAtPath("/Hero/Hair")


def test_an_output_folder_behind_a_link_leads_to_the_shot_from_the_name_it_was_given(shot, tmp_path):
    real = tmp_path / "disk" / "deep" / "cache"
    real.mkdir(parents=True)
    (tmp_path / "cache").symlink_to(real)
    _header(shot, tmp_path / "cache" / "hair.usda")
    assert Usd.Stage.Open(str(tmp_path / "cache" / "hair.usda")).GetPrimAtPath("/Hero/Hair")


def test_a_layer_inside_a_package_is_of_the_packages_file(shot, tmp_path):
    package = tmp_path / "show.usdz"
    with Sdf.ZipFileWriter.CreateNew(str(package)) as archive:
        archive.AddFile(str(shot), "shot.usda")
        archive.AddFile(str(shot.parent / "hero.usda"), "hero.usda")
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/Hero").GetReferences().AddReference(f"{package}[hero.usda]")
    assert stage.GetPrimAtPath("/Hero/Hair") and used_files(stage) == [str(package)]


def test_the_extent_holds_hair_that_grows_wider_over_the_shot(tmp_path, still_model):
    path = write_shot(tmp_path)
    stage = Usd.Stage.Open(str(path))
    widths = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetWidthsAttr()
    widths.Clear()
    widths.Set([0.001], 1)
    widths.Set([0.5], 9)
    stage.Save()
    baked = bake(path, tmp_path / "a.usdc", still_model, frames="1").path
    points, extent = samples(baked, "points", "extent", at=1)
    np.testing.assert_allclose(extent, [points.min(axis=0) - 0.25, points.max(axis=0) + 0.25], atol=1e-5)


@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_the_extent_holds_the_width_of_hair_in_the_unit_of_its_points(tmp_path, still_model, unit):
    """Also if the hair has its own scale."""
    path = write_shot(tmp_path, Recipe(unit=unit, bound="mesh"))
    stage = Usd.Stage.Open(str(path))
    curves = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair"))
    curves.AddScaleOp().Set((2, 2, 2))
    curves.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(np.asarray(curves.GetPointsAttr().Get()) / 2))
    curves.GetWidthsAttr().Set([0.04 / unit])
    stage.Save()
    baked = bake(path, tmp_path / "a.usdc", still_model, frames="1").path
    points, extent = (values * unit for values in samples(baked, "points", "extent", at=1))
    np.testing.assert_allclose(extent, [points.min(axis=0) - 0.02, points.max(axis=0) + 0.02], atol=1e-5)


def test_hair_that_another_character_carries_than_it_is_bound_to_is_not_skinned_by_its_own(tmp_path, still_model):
    layer = Sdf.Layer.FindOrOpen(str(write_shot(tmp_path, Recipe(nesting="/ann"))))
    bob = Sdf.Layer.FindOrOpen(str(write_shot(tmp_path, Recipe(nesting="/bob", frames=5), "bob")))
    Sdf.CopySpec(bob, "/bob", layer, "/bob")
    layer.Save()
    given = {"grooms": ["/ann/Hair"], "skeleton": "/bob/Rig"}
    out = bake(layer.realPath, tmp_path / "hair.usdc", still_model, **given).path
    stage, cache = Usd.Stage.Open(str(out)), UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(stage.GetPrimAtPath("/ann")), Usd.PrimDefaultPredicate)
    (binding,) = cache.ComputeSkelBindings(UsdSkel.Root(stage.GetPrimAtPath("/ann")), Usd.PrimDefaultPredicate)
    assert [str(target.GetPrim().GetPath()) for target in binding.GetSkinningTargets()] == ["/ann/Skin"]
    (again,) = read_shot(out, **given).grooms
    assert again.attachment.rig.path == "/bob/Rig" and bound_skeleton(again.prim) == "/ann/Rig"
    for asked in ({}, {"skeleton": "/bob/Rig"}, given):  # a report measures it on the head that carries it
        baked = read_baked(out, **asked)
        assert {item.path: item.attachment.rig.path for item in baked.shot.grooms} == {"/ann/Hair": "/bob/Rig"}
        assert not any("bake again" in note for note in baked.shot.notes)
    assert not any("bake again" in line for line in inspect(out)["spoils"])


@pytest.mark.parametrize("bound", ["own", "mesh", "none"])
def test_hair_of_a_copied_bake_is_carried_by_the_copy(tmp_path, still_model, bound):
    """Also once flattened, or within one layer, where a path that the bake has recorded would still lead to the first."""
    baked = bake(write_shot(tmp_path, Recipe(bound=bound)), tmp_path / "hair.usda", still_model).path
    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    for name, x, instanceable in (("Hero", 0, False), ("Twin", 0.6, False), ("Third", 1.2, True)):
        prim = stage.DefinePrim(f"/{name}", "SkelRoot")
        prim.GetReferences().AddReference(str(baked), "/Hero")
        prim.SetInstanceable(instanceable)
        UsdGeom.XformCommonAPI(prim).SetTranslate((x, 0, 0))
    stage.Save()
    stage.Flatten().Export(str(tmp_path / "flat.usda"))
    within = Usd.Stage.Open(str(baked))
    UsdGeom.XformCommonAPI(within.DefinePrim("/Twin", "SkelRoot")).SetTranslate((0.6, 0, 0))
    within.GetPrimAtPath("/Twin").GetReferences().AddInternalReference("/Hero")
    within.Save()
    for path, count in ((tmp_path / "two.usda", 3), (tmp_path / "flat.usda", 3), (baked, 2)):
        shot = read_baked(path).shot
        carriers = [(item.path.rpartition("/")[0], item.attachment.rig.path) for item in shot.grooms]
        assert len(carriers) == count and all(rig == f"{root}/Rig" for root, rig in carriers)
        assert not any("bake again" in note for note in shot.notes)
        assert [(each["path"], each["skeleton"]) for each in inspect(path)["grooms"]] == [
            (f"{root}/Hair", rig) for root, rig in carriers
        ]


@pytest.mark.parametrize("bound", ["mesh", "none"])
def test_a_moving_cache_gets_its_shape_at_rest_in_its_own_space(tmp_path, still_model, bound):
    """In centimetres, Z up, for a turned and moved character: the transforms of the points do not commute."""
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], [2, 0.5, -1]
    path = write_shot(tmp_path, Recipe(unit=0.01, up="Z", place=place, bound=bound, frames=9))
    stage = Usd.Stage.Open(str(path))
    points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
    rest = np.array(points.Get())
    plain = bake(path, tmp_path / "plain.usdc", still_model, frames="7:8").path
    seen = {code: samples(plain, "points", at=code) for code in (7, 8)}
    assert np.abs(seen[7] - rest).max() > 1
    points.Clear()
    for code, values in seen.items():
        points.Set(Vt.Vec3fArray.FromNumpy(values), code)
    stage.Save()
    (item,) = read_shot(path).grooms
    out = bake(path, tmp_path / "out.usdc", still_model, frames="1:9").path
    np.testing.assert_allclose(samples(out, "points"), rest, atol=1e-3)
    np.testing.assert_allclose(samples(out, "points", at=7), seen[7], atol=1e-3)
    np.testing.assert_allclose(read_shot(out).grooms[0].groom.points, item.groom.points, atol=1e-5)
