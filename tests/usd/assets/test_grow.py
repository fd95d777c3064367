# SPDX-License-Identifier: Apache-2.0
"""Hairstyles on a USD character: they sit on its head, and training can read them back."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.body.collider import Collider
from neuralocks_core.deformation.model_choice import suited
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.hairstyles import STYLES
from neuralocks_core.rotation import from_vector, transformed
from usd.assets.grow import Barber, grow
from usd.assets.importing import import_groom
from usd.baking.bake import bake
from usd.models import training_scene as training_scene_module
from usd.models.training_scene import training_scene
from usd.shot.stage import read_rigs, read_shot

from ..shots import HEAD, JOINTS, MOTION, Recipe, edited, world_points, write_shot

BODY = Path(__file__).resolve().parents[3] / "examples" / "shot" / "body.usdc"


@pytest.fixture(scope="module")
def grown(tmp_path_factory) -> Path:
    """Hair on the shipped body."""
    return grow("bob", BODY, tmp_path_factory.mktemp("grown") / "bob.usda", count=60, seed=3)


def test_a_style_grows_on_the_head_and_is_repeatable(grown, tmp_path):
    stages = [Usd.Stage.Open(str(path)) for path in (grown, grow("bob", BODY, tmp_path / "2.usda", count=60, seed=3))]
    grooms = [next(p for p in stage.Traverse() if p.IsA(UsdGeom.BasisCurves)) for stage in stages]
    points = [np.array(UsdGeom.BasisCurves(prim).GetPointsAttr().Get()) for prim in grooms]
    assert np.array_equal(*points)
    character = read_rigs(BODY)[0].character
    roots = points[0].reshape(60, -1, 3)[:, 0]
    centre = character.canonical_to_bind[:3, 3] + character.head_centre
    assert np.linalg.norm(roots - centre, axis=1).max() < 0.2


def test_a_character_of_impossible_size_grows_no_hair(tmp_path):
    def far_too_large(stage):
        UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddScaleOp().Set(Gf.Vec3f(1e30))

    shot = edited(tmp_path, far_too_large)
    with pytest.raises(
        NeuralocksError, match="^character: its skin reaches farther than 10000 m from the origin; check met"
    ):
        grow("bob", shot, tmp_path / "out.usda", count=12)
    assert [path.name for path in tmp_path.iterdir()] == [shot.name]


def test_a_training_may_learn_from_variations_of_each_style(tmp_path, monkeypatch):
    monkeypatch.setattr(training_scene_module, "STYLES", {"bob": None, "coils": None})
    monkeypatch.setattr(training_scene_module, "MOST_STRANDS", 40)
    told = []
    few = training_scene(BODY, ["library"]).grooms
    many = training_scene(BODY, ["library"], variations=2, progress=lambda *said: told.append(said)).grooms
    assert (len(few), len(many)) == (2, 6)
    assert told == [(done, 6, f"growing {style}") for done, style in enumerate(["bob", "coils"] * 3)]
    for groom, same in zip(few, many[:2], strict=True):
        np.testing.assert_array_equal(groom.rest, same.rest)
    (alone,) = training_scene(BODY, ["coils"]).grooms
    np.testing.assert_array_equal(alone.rest, few[1].rest)
    assert len(training_scene(BODY, ["coils"], variations=1).grooms) == 2
    # Training learns from what `grow --variation` gives.
    path = grow("coils", BODY, tmp_path / "coils.usda", count=40, seed=1, variation=2)
    (own,) = training_scene(BODY, [str(path)]).grooms
    np.testing.assert_allclose(own.rest, many[5].rest, atol=1e-6)


def test_each_style_moves_by_the_model_that_moves_it_best():
    """Grown from a seed that no training had."""
    character = read_rigs(BODY)[0].character
    barber = Barber(character)
    kinds = {s: suited(None, character, barber.grow(s, 300, seed=7001)).stem for s in STYLES}
    learned = {
        "strands_long": ["long_straight", "wavy", "braid"],
        "strands_short": ["bob", "fringe", "pixie"],
        "strands_spiked": ["mohawk"],
        "strands_curly": ["tight_curls"],
        "strands_coily": ["coils", "afro"],
        "strands_tied": ["ponytail"],
        "strands_pinned": ["bun"],
    }
    assert kinds == {style: kind for kind, styles in learned.items() for style in styles}


def test_variations_are_of_a_style_of_the_library(tmp_path):
    """The user's own grooms have none, and a number below 0 is not a variation."""
    with pytest.raises(NeuralocksError, match="--variations 2.*--groom library"):
        training_scene(BODY, [], variations=2)
    for count in (-1, 51):
        with pytest.raises(NeuralocksError, match=f"--variations {count}: must be from 0 to 50"):
            training_scene(BODY, ["library"], variations=count)


def test_gestures_are_checked_before_anything_is_read(tmp_path):
    with pytest.raises(NeuralocksError, match="--gesture bwo: unknown kind of motion"):
        training_scene(tmp_path / "none.usda", ["library"], gestures={"bwo": 3})
    assert training_scene(BODY, ["coils"], gestures={"bow": 3}).gestures == {"bow": 3}


@pytest.mark.parametrize("unit, up", [(0.01, "Z"), (0.0254, "Y")])
def test_a_groom_suits_the_stage_of_its_character(tmp_path, unit, up):
    """Over a character in another unit or axis, it sits on the head without a transform by the user."""
    shot = write_shot(tmp_path, Recipe(unit=unit, up=up))
    groom = grow("bob", shot, tmp_path / "groom.usda", count=40)
    layer = Sdf.Layer.CreateNew(str(tmp_path / "both.usda"))
    layer.subLayerPaths = [groom.name, shot.name]
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdGeom.SetStageUpAxis(stage, up)
    layer.Save()
    read = read_shot(tmp_path / "both.usda", grooms=["/Groom"])
    character, (item,) = read.rigs[0].character, read.grooms
    roots = item.groom.points[item.groom.starts]
    centre = character.canonical_to_bind[:3, 3] + character.facing.T @ character.head_centre
    assert np.linalg.norm(roots - centre, axis=1).max() < 0.2
    assert not any("counts in" in note for note in read.notes)


def test_what_is_read_is_not_written_over(tmp_path):
    """`grow` must not replace the character with a groom, nor `import` the shot, under any of their names."""
    folder = tmp_path / "shot"
    shutil.copytree(BODY.parent, folder)
    (tmp_path / "link").symlink_to(folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    missing = folder / "not there yet" / ".." / "shot.usda"
    for out in (folder / "shot.usda", folder / "body.usdc", tmp_path / "link" / "groom.usdc", missing):
        for work in (grow, import_groom):
            words = ("bob", folder / "shot.usda", out, 8) if work is grow else (folder / "shot.usda", out)
            with pytest.raises(NeuralocksError, match=f"{out.name}: is read as well"):
                work(*words)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    ("name", "words"), [("x.txt", "end its name with .usd"), ("file/x.usda", "not a folder, on the way")]
)
def test_where_nothing_can_be_written_is_told_before_it_grows(tmp_path, monkeypatch, name, words):
    """Growing a full head takes a minute."""
    (tmp_path / "file").touch()
    monkeypatch.setattr(Barber, "grow", None)
    with pytest.raises(NeuralocksError, match=words):
        grow("bob", BODY, tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_hair_grows_on_the_head_below_a_halo_as_without_it(grown, tmp_path):
    stage = Usd.Stage.Open(str(shutil.copy(BODY, tmp_path / "angel.usdc")))
    head = read_rigs(BODY)[0].character.canonical_to_bind[:3, 3]
    name = next(
        n for n in UsdSkel.Skeleton(stage.GetPrimAtPath("/Body/Rig")).GetJointsAttr().Get() if n.endswith("/head")
    )
    halo, ball = UsdGeom.Mesh.Define(stage, "/Body/Halo"), trimesh.creation.icosphere(2, 0.1)
    halo.CreatePointsAttr(Vt.Vec3fArray.FromNumpy((ball.vertices + head + [0, 0.35, 0]).astype(np.float32)))
    halo.CreateFaceVertexCountsAttr([3] * len(ball.faces))
    halo.CreateFaceVertexIndicesAttr(ball.faces.ravel().tolist())
    binding = UsdSkel.BindingAPI.Apply(halo.GetPrim())
    binding.CreateSkeletonRel().SetTargets(["/Body/Rig"])
    binding.CreateJointsAttr([name])
    binding.CreateJointIndicesPrimvar(True, 1).Set([0])
    binding.CreateJointWeightsPrimvar(True, 1).Set([1.0])
    stage.Save()
    below = grow("bob", tmp_path / "angel.usdc", tmp_path / "below.usda", count=60, seed=3)
    assert below.read_bytes() == grown.read_bytes()


@pytest.mark.parametrize("change", ["turned", "scaled"])
def test_hair_sits_where_a_bake_finds_it(tmp_path, model, change):
    """On a character whose parents turn it, hair sat askew on its head; on one whose head the animation scales, no bake found it."""
    turn = np.eye(4)
    turn[:3, :3] = from_vector(np.array([0, np.radians(140), 0]))
    turn[:3, 3] = 2, 0, -1
    shot = write_shot(tmp_path, Recipe(bound="mesh", place=turn if change == "turned" else None))
    if change == "scaled":
        layer = Sdf.Layer.FindOrOpen(str(shot))
        scales = [(1, 1, 1)] * len(JOINTS)
        scales[HEAD] = (1.5, 1.5, 1.5)
        layer.GetAttributeAtPath(f"{MOTION}.scales").default = Vt.Vec3hArray(scales)
        layer.Save()
    rig = read_rigs(shot)[0]
    grown = Barber(rig.character).grow("bob", 200, 0)
    out = grow("bob", shot, tmp_path / "grown.usda", count=200, with_character=True)
    (item,) = read_shot(out, ["/Groom/bob"]).grooms
    assert item.groom.points == pytest.approx(grown.points, abs=1e-5)
    bake(out, tmp_path / "hair.usdc", model, grooms=["/Groom/bob"])
    if change == "turned":  # and so before a bake
        skin = Collider(
            transformed(rig.character.body.points, turn @ np.linalg.inv(rig.to_bind)), rig.character.body.triangles
        )
        roots = world_points(out, 1.0, "/Groom/bob")[grown.starts]
        assert np.abs(skin.distance(roots, limit=0.1)[0]).max() < 1e-3


def test_hair_grows_on_giants(grown, tmp_path):
    """Twenty times life size: no triangle of the crown was as near to the head's axis as a person's."""
    giant = tmp_path / "giant.usda"
    stage = Usd.Stage.CreateNew(str(giant))
    UsdGeom.SetStageMetersPerUnit(stage, 20)
    UsdGeom.SetStageUpAxis(stage, "Y")
    stage.GetRootLayer().subLayerPaths.append(BODY.as_posix())
    stage.Save()
    (large,), _ = import_groom(grow("bob", giant, tmp_path / "large.usda", count=60, seed=3), tmp_path / "l.usda")
    (small,), _ = import_groom(grown, tmp_path / "s.usda")
    size = [np.ptp(groom.points, axis=0) for groom in (large, small)]
    assert size[0] == pytest.approx(20 * size[1], rel=0.05)


def test_what_cannot_grow_is_told_before_the_head_is_looked_at(tmp_path, monkeypatch):
    """That takes seconds."""
    monkeypatch.setattr("usd.assets.grow.read_rigs", None)
    with pytest.raises(NeuralocksError, match="long_straight"):
        grow("mullet", BODY, tmp_path / "x.usda")
    with pytest.raises(NeuralocksError, match="no variation -1"):
        grow("bob", BODY, tmp_path / "bob.usda", count=5, variation=-1)
