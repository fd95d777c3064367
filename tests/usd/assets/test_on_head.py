# SPDX-License-Identifier: Apache-2.0
"""Hair files put on a character's head: where it grew, sized as the head, and told where it cannot be right."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, Vt

from neuralocks_core.body.head_field import HeadField
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.groom import Groom
from tests.core.formats.groom_files import put
from tests.shared_data import SHARED
from usd.assets.groom import write_groom
from usd.assets.grow import grow
from usd.assets.importing import import_groom
from usd.baking.bake import bake
from usd.review.evaluate import evaluate
from usd.shot.stage import read_rigs, read_shot

from ..commands import status
from ..shots import Recipe, world_points, write_shot

SHOT = Path(__file__).resolve().parents[3] / "examples" / "shot" / "shot.usda"
BODY = SHOT.with_name("body.usdc")


@pytest.fixture(scope="module")
def foreign(tmp_path_factory) -> Path:
    """A hairstyle of the shipped body's head, elsewhere and of another size."""
    folder = tmp_path_factory.mktemp("hair")
    (groom,), _ = import_groom(grow("bob", BODY, folder / "own.usda", count=200), folder / "again.usda")
    moved = Groom("Bob", 37 * groom.points + np.float32([5, -80, 3]), groom.counts, 37 * groom.widths)
    return write_groom(folder / "foreign.usda", moved)


@pytest.fixture(scope="module")
def fitted(foreign):
    """That hair on the shipped body's head, and the notes on it."""
    (groom,), notes = import_groom(foreign, foreign.with_name("fitted.usda"), character=BODY)
    return groom, notes


def test_hair_is_put_back_where_it_grew(fitted, foreign, tmp_path):
    """Up to the few millimetres that a sphere is off a skull."""
    groom, notes = fitted
    (own,), _ = import_groom(foreign.with_name("own.usda"), tmp_path / "own.usda")
    apart = np.linalg.norm(groom.points - own.points, axis=1)
    assert np.median(apart) < 0.008 and apart.max() < 0.04
    body = read_rigs(BODY)[0].surface
    assert np.abs(body.distance(groom.points[groom.starts])[0]).max() < 1e-5
    assert any("put on the head of /Body/Rig, made 0.0269 times as large; strands" in note for note in notes), notes


@pytest.mark.parametrize("basis", ["catmullRom", "bspline"])
def test_curves_are_put_on_a_head_by_what_is_drawn_of_them(basis, foreign, fitted, tmp_path):
    """Points beyond the ends of curves that are not pinned lie in the skull: they go with the hair, and do not seat it."""
    (own,), _ = import_groom(foreign, tmp_path / "own.usda")
    count = int(own.counts[0])
    points = own.points.reshape(-1, count, 3)
    ends = [2 * points[:, :1] - points[:, 1:2], points, 2 * points[:, -1:] - points[:, -2:-1]]
    more = np.concatenate(ends, axis=1)
    widths = np.repeat(own.widths[:1], more.shape[0] * more.shape[1])
    path = write_groom(tmp_path / "more.usda", Groom("Bob", more.reshape(-1, 3), own.counts + 2, widths))
    stage = Usd.Stage.Open(str(path))
    (prim,) = (prim for prim in stage.Traverse() if prim.IsA(UsdGeom.BasisCurves))
    curves = UsdGeom.BasisCurves(prim)
    curves.GetTypeAttr().Set("cubic")
    curves.CreateBasisAttr(basis)
    curves.CreateWrapAttr("nonperiodic")
    sizes = UsdGeom.PrimvarsAPI(prim).CreatePrimvar("widths", Sdf.ValueTypeNames.FloatArray, "vertex").GetAttr()
    for code, times in ((1.0, 1.0), (2.0, 1.5)):
        sizes.Set(Vt.FloatArray([float(times * widths[0])] * len(widths)), code)
    stage.Save()
    (groom,), notes = import_groom(path, tmp_path / "on.usda", character=BODY)
    assert any("its widths change over time" in note for note in notes)
    on = groom.points.reshape(more.shape)
    np.testing.assert_allclose(on[:, 1:-1], fitted[0].points.reshape(points.shape), atol=1e-4)
    for outer, near in ((0, 1), (-1, -2)):
        before, after = (np.linalg.norm(p[:, outer] - p[:, near], axis=1) for p in (more, on))
        np.testing.assert_allclose(after, np.median(after / before) * before, rtol=1e-3, atol=1e-6)
        assert np.median(after / before) == pytest.approx(0.0269, rel=0.01)


def test_a_beard_does_not_move_the_hair_it_is_imported_with(foreign, fitted, tmp_path):
    """Its roots are far from the skull's sphere: the hair became a fifth smaller, and the beard sat below the eyes."""
    rig = read_rigs(BODY)[0]
    character, skin = rig.character, rig.character.body.points
    at = character.canonical(skin) - character.head_centre
    chin = skin[character.on_head & (at[:, 1] < -0.08) & (at[:, 1] > -0.13) & (at[:, 2] > 0.05)]
    chin = chin[np.argsort(-np.linalg.norm(chin - skin.mean(axis=0), axis=1), kind="stable")[:200]]
    points = np.stack([chin, chin + [0, -0.03, 0.01]], axis=1).reshape(-1, 3)
    points = (37 * points + [5, -80, 3]).astype(np.float32)
    beard = write_groom(tmp_path / "beard.usda", Groom("Beard", points, np.full(200, 2), np.ones(1, np.float32)))
    alone, _ = fitted
    (hair, on), notes = import_groom([foreign, beard], tmp_path / "both.usda", character=BODY)
    assert np.linalg.norm(hair.points - alone.points, axis=1).max() < 0.003
    assert np.median(np.linalg.norm(on.points[::2] - chin, axis=1)) < 0.005
    assert [note.split(" of its")[0] for note in notes if "off the scalp" in note] == ["/Groom/Beard: 100%"]


def test_hair_that_faces_backwards_is_told_and_stays_out_of_the_mouth(foreign, tmp_path):
    """A third of it grows from the face, but not from the insides of the lips, where no bake could get it out."""
    (groom,), _ = import_groom(foreign, tmp_path / "as_it_is.usda")
    turned = write_groom(tmp_path / "back.usda", replace(groom, points=groom.points * np.float32([-1, 1, -1])))
    (groom,), notes = import_groom(turned, tmp_path / "on.usda", character=BODY)
    assert any("of its roots lie off the scalp" in note and "turn the hair to face forward" in note for note in notes)
    character = read_rigs(BODY)[0].character
    field = HeadField(character.canonical(character.body.points), character.body.triangles, character.on_head)
    assert field.distance(character.canonical(groom.points[groom.starts]))[0].min() > -0.004


def test_a_unit_is_not_asked_for_where_the_head_sizes_the_hair(foreign, fitted, tmp_path):
    """A file of metres by its format, but written in another unit; whoever followed that advice got hair that was not sized."""
    (groom,), _ = import_groom(foreign, tmp_path / "as_it_is.usda")
    strands = np.split(groom.points, groom.starts[1:])
    parts = [np.int32(len(points)).tobytes() + points.astype("<f4").tobytes() for points in strands]
    file = put(tmp_path, "hair.data", np.int32(len(parts)).tobytes() + b"".join(parts))
    assert any("import --unit" in note for note in import_groom(file, tmp_path / "raw.usda")[1])
    (on,), notes = import_groom(file, tmp_path / "on.usda", character=BODY)
    assert not any("--unit" in note for note in notes)
    assert on.points == pytest.approx(fitted[0].points, abs=1e-5)


def test_of_a_stated_unit_the_size_stays(foreign, tmp_path):
    (groom,), notes = import_groom(foreign, tmp_path / "fitted.usda", "cm", character=BODY)
    lengths = [
        np.linalg.norm(np.diff(points[:2], axis=0))
        for points in (groom.points, world_points(foreign, 0.0, "/Groom/Bob"))
    ]
    assert lengths[0] == pytest.approx(0.01 * lengths[1], rel=1e-4)
    assert "times as large" not in notes[-1]


def test_a_layer_over_the_character_bakes_as_it_is(tmp_path, model, foreign):
    """In the character's unit and axis, and beside the hair that the shot has."""
    shot = write_shot(tmp_path, Recipe(unit=0.01, up="Z", bound="mesh"))
    grown = grow("bob", shot, tmp_path / "more" / "grown.usda", count=30, with_character=True)
    assert {item.path for item in read_shot(grown).grooms} == {"/Hero/Hair", "/Groom/bob"}
    out = tmp_path / "more" / "twice.usda"
    _, notes = import_groom([foreign, foreign], out, character=grown, with_character=True)
    assert any(note.startswith("/Hero/Hair and 1 more: grown.usda has this hair already") for note in notes)
    stage = Usd.Stage.Open(str(out))
    assert UsdGeom.GetStageUpAxis(stage) == "Z" and UsdGeom.GetStageMetersPerUnit(stage) == 0.01
    assert stage.GetDefaultPrim().GetName() == "Hero" and stage.GetEndTimeCode() == 9
    grooms = {item.path for item in read_shot(out).grooms}
    assert grooms == {"/Hero/Hair", "/Groom/bob", "/Groom_2/Bob", "/Groom_2/Bob_2"}
    result = bake(out, tmp_path / "hair.usdc", model)
    assert {groom["path"] for groom in result.grooms} == grooms
    head = read_rigs(shot)[0].character.canonical_to_bind[:3, 3]
    assert np.linalg.norm(world_points(out, 1.0, "/Groom_2/Bob") - head, axis=1).max() < 0.5


def test_hair_that_is_replaced_is_off_in_the_layer_alone(tmp_path, foreign, capsys):
    """Also within an instance, in which nothing can be changed."""
    path = write_shot(tmp_path)
    shot = tmp_path / "instance.usda"
    stage = Usd.Stage.CreateNew(str(shot))
    stage.DefinePrim("/Cast/Hero").GetReferences().AddReference(str(path), "/Hero")
    stage.GetPrimAtPath("/Cast/Hero").SetInstanceable(True)
    stage.SetMetadata("startTimeCode", 1), stage.SetMetadata("endTimeCode", 9)
    stage.Save()
    for file, hair, words in (
        (shot, "/Cast/Hero/Hair", ("grow", "bob", "--count", "30")),
        (path, "/Hero/Hair", ("import", str(foreign))),
    ):
        out = tmp_path / f"{file.stem}_new.usda"
        assert status(*words, "--character", str(file), "--with-character", "--replace", hair, "-o", str(out)) == 0
        assert {item.path.split("/")[1] for item in read_shot(out).grooms} == {"Groom"}
        assert {item.path for item in read_shot(file).grooms} == {hair}
    assert "has this hair already" not in capsys.readouterr().err
    for wrong, told in (
        (
            {"with_character": True, "replaced": "/Hero/Wig"},
            "/Hero/Wig: no such prim; the stage's grooms are: /Hero/Hair",
        ),
        ({"replaced": "/Hero/Hair"}, "--replace: only a layer .* add --with-character"),
    ):
        with pytest.raises(NeuralocksError, match=told):
            grow("bob", path, tmp_path / "no.usda", count=30, **wrong)
    with pytest.raises(NeuralocksError, match="--replace: there is no character"):
        import_groom(foreign, tmp_path / "no.usda", replaced="/Hero/Hair")
    assert not (tmp_path / "no.usda").exists()


def test_what_cannot_be_put_on_a_head_is_refused(tmp_path, foreign):
    shot = write_shot(tmp_path, Recipe(bound="none"))
    before = shot.read_bytes()
    few = write_groom(
        tmp_path / "few.usda", Groom("Few", np.eye(3, dtype=np.float32), np.array([3]), np.ones(1, np.float32))
    )
    for source, wrong, said in (
        (foreign, {"character": shot}, "a character with skin"),
        (few, {"character": BODY}, "few.usda: groom: has fewer than 4 strands"),
        (foreign, {"with_character": True}, "--with-character: there is no character; name one with --character"),
        (foreign, {"head": "head"}, "--head: there is no character"),
        (foreign, {"character": tmp_path / "nobody.usda"}, "nobody.usda: no such file"),
    ):
        with pytest.raises(NeuralocksError, match=said):
            import_groom(source, tmp_path / "out.usda", **wrong)
    with pytest.raises(NeuralocksError, match="shot.usda"):
        import_groom(foreign, shot, character=shot)
    assert shot.read_bytes() == before and not (tmp_path / "out.usda").exists()


def test_the_command_puts_several_files_on_one_head(tmp_path, foreign, capsys):
    words = ["import", foreign, foreign, "-o", tmp_path / "two.usda", "--character", BODY, "--json"]
    assert status(*words) == 0
    told = json.loads(capsys.readouterr().out)
    assert [groom["strands"] for groom in told["grooms"]] == [200, 200]
    called, _ = import_groom([foreign, foreign], tmp_path / "called.usda", character=BODY)
    assert (tmp_path / "called.usda").read_bytes() == (tmp_path / "two.usda").read_bytes()


@pytest.mark.skipif(not SHARED.is_dir(), reason="no real grooms here")
@pytest.mark.parametrize("names", [("ruby/ruby_long_hair", "ruby/ruby_short_hair"), ("sintel/sintel_hair",)])
def test_real_hair_lies_on_another_head_and_bakes(tmp_path, names, model):
    files = [SHARED / "grooms" / f"{name}.tfx" for name in names]
    grooms, _ = import_groom(files, tmp_path / "real.usda", character=SHOT, with_character=True)
    body = read_rigs(SHOT)[0].surface
    for groom in grooms:
        used = groom.counts > 0
        assert np.abs(body.distance(groom.points[groom.starts[used]], limit=0.1)[0]).max() < 1e-4
        some = groom.points[np.repeat(np.arange(len(used)) % 5 == 0, groom.counts)]
        assert (body.distance(some, limit=0.01)[0] < -0.003).mean() < 1e-3
    paths = [f"/Groom/{Path(name).name}" for name in names]
    out = bake(tmp_path / "real.usda", tmp_path / "hair.usdc", model, grooms=paths, frames="70").path
    card = evaluate(out, grooms=paths)
    assert all(card.grooms[path]["inside_at_rest_percent"] < 6 for path in paths)  # roots lie on the skin
