# SPDX-License-Identifier: Apache-2.0
"""Hair files imported as they are, and hair grown on a character, from file to bake."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt
from scipy.spatial.transform import Rotation

from neuralocks_core.errors import NeuralocksError
from tests.core.formats.groom_files import put, tressfx_text
from usd.assets.groom import _free_path
from usd.assets.grow import grow
from usd.assets.importing import import_groom
from usd.baking.bake import bake

from ..shots import Recipe, edited, place_skeleton, strand_points, world_points, write_shot

SHOT = Path(__file__).resolve().parents[3] / "examples" / "shot" / "shot.usda"
BODY = SHOT.with_name("body.usdc")


def test_hair_from_tip_to_root_is_told_where_the_file_has_its_skin(tmp_path):
    def turn(stage):
        points = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")).GetPointsAttr()
        points.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(np.array(points.Get())[::-1])))

    told = [
        any("run from tip to root" in note for note in import_groom(shot, tmp_path / f"{name}.usda")[1])
        for name, shot in (("as it is", write_shot(tmp_path)), ("turned", edited(tmp_path / "other", turn)))
    ]
    assert told == [False, True]


def test_what_an_import_leaves_out_or_takes_for_granted_is_told(tmp_path):
    stage = Usd.Stage.CreateNew(str(tmp_path / "ribbons.usda"))
    points = strand_points(30, 6)
    hair = UsdGeom.BasisCurves.Define(stage, "/Hair/Locks")
    hair.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.reshape(-1, 3).astype(np.float32)))
    hair.CreateCurveVertexCountsAttr([6] * 30)
    hair.CreateNormalsAttr([(0, 1, 0)] * 30)
    for name, rows in (("front", range(15)), ("back", range(15, 30))):
        UsdGeom.Subset.CreateGeomSubset(hair, name, "curve", list(rows), "materialBind")
    for name in ("Guides", "More"):
        UsdGeom.NurbsCurves.Define(stage, f"/Hair/{name}")
    stage.DefinePrim("/Hair/Lost").GetReferences().AddReference("./nothing.usda")
    stage.Save()
    told = {
        "no metersPerUnit, so a unit counts as a centimetre",
        "its normals, which make ribbons, are not imported",
        "its 2 subsets, such as front, are not imported",
        "/Hair/Guides: its NurbsCurves are left out; if they are hair, convert them to BasisCurves",
        "/Hair/More: its NurbsCurves are left out; if they are hair, convert them to BasisCurves",
        "nothing.usda",
    }
    for options, without in (
        ({}, set()),
        ({"unit": "m"}, {"no metersPerUnit"}),
        ({"character": BODY}, {"no metersPerUnit"}),
    ):
        _, notes = import_groom(tmp_path / "ribbons.usda", tmp_path / "out.usda", **options)
        said = {text for text in told if any(text in note for note in notes)}
        assert told - said == {text for text in told if any(text.startswith(each) for each in without)}, notes


@pytest.mark.parametrize(
    ("kind", "basis"), [("token", "hermite"), ("token", "power"), ("token", "b-spline"), ("string", "bspline")]
)
def test_curves_of_an_unknown_basis_are_imported(kind, basis, tmp_path):
    """USD's own count of their values divides by zero, which ended the program without a word."""
    shot = edited(tmp_path, lambda stage: stage.GetPrimAtPath("/Hero/Hair").GetAttribute("type").Set("cubic"))
    layer = Sdf.Layer.FindOrOpen(str(shot))
    Sdf.CreatePrimAttributeInLayer(layer, "/Hero/Hair.basis", Sdf.ValueTypeNames.Find(kind), Sdf.VariabilityUniform)
    layer.GetAttributeAtPath("/Hero/Hair.basis").default = basis
    layer.Save()
    (groom,), _ = import_groom(shot, tmp_path / "out.usda")
    assert groom.strand_count == 40
    layer.GetAttributeAtPath("/Hero/Hair.basis").default = "bspline"
    layer.SetTimeSample("/Hero/Hair.basis", 1.0, basis)
    layer.Save()
    (groom,), _ = import_groom(shot, tmp_path / "out.usda")
    assert groom.strand_count == 40
    hair = layer.GetPrimAtPath("/Hero/Hair")
    hair.RemoveProperty(hair.attributes["basis"])
    Sdf.RelationshipSpec(hair, "basis")
    layer.Save()
    (groom,), _ = import_groom(shot, tmp_path / "out.usda")
    assert groom.strand_count == 40


def test_parts_in_one_unknown_unit_keep_together(tmp_path):
    """A braid's few roots alone would be taken for another unit."""
    rng, files = np.random.default_rng(0), []
    for name, spread in (("head", 45.0), ("braid", 2.0)):  # mm
        points = rng.normal(0, spread, (40, 3))
        files.append(put(tmp_path, f"{name}.tfx", tressfx_text(points, [2] * 20)))
    both, notes = import_groom(files, tmp_path / "both.usda")
    (alone,), _ = import_groom(files[1], tmp_path / "alone.usda")
    size = [np.ptp(groom.points, axis=0).max() for groom in (*both, alone)]
    assert size[0] > 15 * size[1] and size[2] > 5 * size[1]
    (told,) = [note for note in notes if "unit" in note]
    assert told.startswith(f"{files[0]}, {files[1]}: do not state their unit; took 1 mm, by which the scalp is ")


def test_numbers_of_files_are_in_the_names_of_prims(tmp_path):
    """A prim's name cannot begin with one, nor have a point, and else only their order would tell hair 1 from hair 2."""
    names = ("12", "3 braid", "bun.v1", "bun.v2")
    files = [put(tmp_path, f"{name}.tfx", tressfx_text(np.eye(4, 3), [2, 2])) for name in names]
    out = tmp_path / "both.usda"
    import_groom(files, out, "m")
    stage = Usd.Stage.Open(str(out))
    curves = [prim.GetName() for prim in stage.Traverse() if prim.IsA(UsdGeom.BasisCurves)]
    assert curves == ["_12", "_3_braid", "bun_v1", "bun_v2"]


def test_hair_that_a_skeleton_carries_is_imported_where_skinning_shows_it(tmp_path):
    """Its own space is tied to the skeleton by the geomBindTransform; the prim's transform does not count."""
    rest = strand_points(6, 4).reshape(-1, 3)

    def change(stage):
        hair, bind = UsdGeom.BasisCurves(stage.GetPrimAtPath("/Hero/Hair")), Gf.Matrix4d().SetScale(0.01)
        bind.SetTranslateOnly((0, 1, 0))
        hair.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy((100 * (rest - [0, 1, 0])).astype(np.float32)))
        hair.GetWidthsAttr().Set([0.01])
        hair.AddTranslateOp().Set((0, 7, 0))
        UsdSkel.BindingAPI(hair).GetGeomBindTransformAttr().Set(bind)
        UsdGeom.Xformable(stage.GetPrimAtPath("/Hero/Rig")).AddTranslateOp().Set((3, 0, 0))

    (groom,), _ = import_groom(edited(tmp_path, change, Recipe(strands=6, vertices=4)), tmp_path / "groom.usda")
    np.testing.assert_allclose(groom.points, rest + [3, 0, 0], atol=1e-6)
    np.testing.assert_allclose(groom.widths, 1e-4, rtol=1e-5)


@pytest.mark.parametrize(("size", "turn", "up"), [(0.01, (-90, 0, 0), 0), (1, (0, 15, 0), 0), (1, (0, 0, 0), 0.01)])
def test_bind_transforms_may_be_in_the_worlds_space(size, turn, up, tmp_path, model):
    """As USD means them, and Blender writes them: hair was imported 100 times too small, and grown hair turned on the head by 15
    degrees.
    """
    recipe, place = Recipe(bound="own"), np.eye(4)
    place[:3, :3], place[1, 3] = size * Rotation.from_euler("xyz", turn, degrees=True).as_matrix(), up
    plain = write_shot(tmp_path / "plain", recipe)
    placed = edited(tmp_path / "placed", lambda stage: place_skeleton(stage, place), recipe)
    found = [import_groom(path, path.with_name("groom.usda"))[0][0] for path in (plain, placed)]
    np.testing.assert_allclose(found[1].points, found[0].points, atol=1e-6)
    np.testing.assert_allclose(found[1].widths, found[0].widths, rtol=1e-5)
    outs = []
    for path in (plain, placed):
        grow("bob", path, path.with_name("grown.usda"), count=60, with_character=True)
        outs.append(path.with_name("grown.usda"))
        outs.append(bake(outs[-1], path.with_name("hair.usda"), model, grooms=["/Groom/bob"], frames="5").path)
    for one, other in zip(outs[:2], outs[2:], strict=True):
        points = [world_points(each, 5.0, "/Groom/bob") for each in (one, other)]
        np.testing.assert_allclose(points[1], points[0], atol=2e-5)


def test_a_range_that_the_character_lacks_is_not_made_up(tmp_path):
    """It would hide the animation that the character gets later."""
    out = grow("bob", BODY, tmp_path / "grown.usda", count=20, with_character=True)
    assert not Usd.Stage.Open(str(out)).HasAuthoredTimeCodeRange()


def test_a_name_that_the_shot_lists_may_be_grown_if_nothing_lies_over_the_shot(tmp_path):
    shot = write_shot(tmp_path, Recipe(bound="mesh"))
    layer = Sdf.Layer.FindOrOpen(str(shot))
    layer.subLayerPaths.append("./later.usda")
    layer.Save()
    grow("bob", shot, tmp_path / "later.usda", count=5)
    with pytest.raises(NeuralocksError, match="later.usda"):
        grow("bob", shot, tmp_path / "later.usda", count=5, with_character=True)


@pytest.mark.parametrize(
    ("name", "words"), [("x.txt", "end its name with .usd"), ("file/x.usda", "not a folder, on the way")]
)
def test_where_nothing_can_be_written_is_told_before_anything_is_read(tmp_path, name, words):
    """Putting a full head of hair on a character takes a minute."""
    (tmp_path / "file").touch()
    with pytest.raises(NeuralocksError, match=words):
        import_groom(tmp_path / "unread.tfx", tmp_path / name, character=tmp_path / "unread.usda")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_thousands_of_curves_of_one_name_get_names_at_once():
    """Each began to look for a free number at 2."""
    taken = set()

    class Stage:
        asked = 0

        def GetPrimAtPath(self, path):
            self.asked += 1
            return path in taken

    stage, numbers = Stage(), {}
    for _ in range(100):
        taken.add(_free_path(stage, Sdf.Path("/Groom"), "Hair", numbers))
    assert len(taken) == 100 and Sdf.Path("/Groom/Hair_100") in taken and stage.asked <= 300


def test_no_file_at_all_is_refused(tmp_path):
    with pytest.raises(NeuralocksError, match="^source: is an empty list; name the hair files"):
        import_groom([], tmp_path / "out.usda")
    assert not list(tmp_path.iterdir())
