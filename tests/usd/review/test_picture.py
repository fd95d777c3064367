# SPDX-License-Identifier: Apache-2.0
"""What a preview of a bake says."""

import inspect

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.baking.bake import bake
from usd.cli.app import preview_command
from usd.review import baked as reading
from usd.review import picture
from usd.review.baked import read_baked

from ..shots import Recipe, world_points, write_shot


def test_it_tells_whose_hair_is_not_drawn(tmp_path, monkeypatch):
    """Of several characters the first is drawn: without a word of it, the other's hair would seem to be lost."""
    monkeypatch.setattr(picture.drawing, "render", lambda scene, path, **_: path)
    hero, both, told = write_shot(tmp_path, Recipe(bound="mesh", strands=4)), tmp_path / "both.usda", []
    stage = Usd.Stage.CreateNew(str(both))
    for name, x in (("Anna", -1.0), ("Bert", 1.0)):
        prim = stage.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference(str(hero), "/Hero")
        UsdGeom.XformCommonAPI(prim).SetTranslate((x, 0, 0))
    stage.SetTimeCodesPerSecond(24)
    stage.Save()
    bake(both, tmp_path / "hair.usda", frames="1:2")
    picture.preview(tmp_path / "hair.usda", "hair.png", tell=told.extend)
    assert told == ["/Anna/Rig: one of 2 characters is drawn; choose another, such as /Bert/Rig, with --skeleton PRIM"]
    told.clear()
    picture.preview(tmp_path / "hair.usda", "hair.png", skeleton="/Bert/Rig", tell=told.extend)
    picture.preview(tmp_path / "hair.usda", "hair.png", grooms=["/Anna/Hair"], tell=told.extend)
    assert told == []
    for module in (picture, reading):
        monkeypatch.setattr(module, "MOST_BODY_POINTS", 100)
    picture.preview(tmp_path / "hair.usda", "hair.png", skeleton="/Bert/Rig", tell=told.extend)
    assert told == ["/Bert/Rig: its body has 416 points, more than 100, so only its hair is drawn"]


def test_all_hair_of_one_person_in_two_skeletons_is_drawn(tmp_path, monkeypatch):
    scenes, told = [], []
    monkeypatch.setattr(picture.drawing, "render", lambda scene, path, **_: scenes.append(scene))
    path = write_shot(tmp_path, Recipe(strands=4))
    layer = Sdf.Layer.FindOrOpen(str(path))
    Sdf.CopySpec(layer, "/Hero", layer, "/Face")
    stage = Usd.Stage.Open(layer)
    for prim in Usd.PrimRange(stage.GetPrimAtPath("/Face")):
        for relation in prim.GetRelationships():
            relation.SetTargets([each.ReplacePrefix("/Hero", "/Face") for each in relation.GetTargets()])
    layer.Save()
    bake(path, tmp_path / "hair.usda", frames="1:2")
    picture.preview(tmp_path / "hair.usda", "hair.png", tell=told.extend)
    assert len(scenes[0].counts) == 8 and len(scenes[0].hair(0)) == scenes[0].counts.sum() and told == []


def test_a_hidden_character_is_not_said_to_be_drawn(tmp_path, monkeypatch):
    """The note named it, and as another choice the one that was drawn."""
    monkeypatch.setattr(picture.drawing, "render", lambda scene, path, **_: path)
    hero, told = write_shot(tmp_path, Recipe(bound="own", strands=4)), []
    stage = Usd.Stage.CreateNew(str(tmp_path / "both.usda"))
    for name, x in (("Anna", -1.0), ("Bert", 1.0)):
        prim = stage.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference(str(hero), "/Hero")
        UsdGeom.XformCommonAPI(prim).SetTranslate((x, 0, 0))
    UsdGeom.Imageable(stage.GetPrimAtPath("/Anna")).MakeInvisible()
    UsdGeom.SetStageMetersPerUnit(stage, 1)
    stage.SetTimeCodesPerSecond(24)
    stage.Save()
    bake(tmp_path / "both.usda", tmp_path / "hair.usda", frames="1:2")
    picture.preview(tmp_path / "hair.usda", "hair.png", tell=told.extend)
    assert told == ["/Bert/Rig: one of 2 characters is drawn; choose another, such as /Anna/Rig, with --skeleton PRIM"]


@pytest.mark.parametrize("recipe", [Recipe(bound="own", strands=4), Recipe(bound="own", strands=4, unit=0.01, up="Z")])
def test_hair_that_is_not_baked_is_drawn_as_it_was_groomed(tmp_path, monkeypatch, recipe):
    """Where USD's own skinning puts it; in the first frame, unless others are asked for."""
    scenes, named, told, path = [], [], [], write_shot(tmp_path, recipe)
    monkeypatch.setattr(picture.drawing, "_strip", lambda part, images, names: (named.extend(names), part.touch()))
    drawn = picture.drawing.render
    monkeypatch.setattr(picture.drawing, "render", lambda scene, *a, **k: (scenes.append(scene), drawn(scene, *a, **k)))
    picture.preview(path, tmp_path / "first.png", size=(32, 40), tell=told.extend)
    picture.preview(path, tmp_path / "some.png", size=(32, 40), frames="3:5")
    assert named == ["frame 1", "frame 3", "frame 4", "frame 5"]
    assert told == [f"{path}: its hair is not baked, so it is drawn as it was groomed, stiff on the head"]
    stage = Usd.Stage.Open(str(path))
    UsdSkel.BakeSkinning(stage.Traverse())
    stage.Export(str(tmp_path / "skinned.usda"))
    for code in (1, 5):
        skinned = world_points(tmp_path / "skinned.usda", code)
        np.testing.assert_allclose(scenes[1].hair(code - 1), skinned, atol=1e-5)
    np.testing.assert_array_equal(scenes[0].hair(0), scenes[1].hair(0))
    assert np.abs(scenes[1].hair(4) - scenes[1].hair(0)).max() > 0.01


@pytest.fixture(scope="module")
def hair(tmp_path_factory):
    """A bake of frames 5 to 12, with motion blur."""
    folder = tmp_path_factory.mktemp("hair")
    return bake(write_shot(folder, Recipe(strands=8)), folder / "hair.usdc", frames="5:12", subframes=2).path


@pytest.mark.parametrize(
    "frames, shown",
    [
        ("7:10", [7, 8, 9, 10]),
        ("6", [6]),
        ("6:12:3", [6, 9, 12]),
        ("5:12:0.5", [5, 6.5, 8, 9, 10.5, 12]),
        (None, [6, 7, 8, 9.5, 10.5, 11.5]),
    ],
)
def test_a_strip_shows_the_frames_asked_for_and_names_them(hair, tmp_path, monkeypatch, frames, shown):
    """Six of them if there are more than twelve."""
    named = []
    monkeypatch.setattr(picture.drawing, "_strip", lambda part, images, names: (named.extend(names), part.touch()))
    picture.preview(hair, tmp_path / "hair.png", frames=frames, size=(32, 40))
    assert named == [f"frame {frame:g}" for frame in shown]


def test_a_strip_of_a_turntable_names_the_side_as_well(hair, tmp_path, monkeypatch):
    """Round a single frame, that alone tells its pictures apart."""
    named = []
    monkeypatch.setattr(picture.drawing, "_strip", lambda part, images, names: (named.extend(names), part.touch()))
    picture.preview(hair, tmp_path / "hair.png", frames="6", turntable=True, view=-30, size=(32, 40))
    assert named == [f"frame 6, {angle}°" for angle in (-30, 30, 90, 150, 210, 270)]


def test_a_turntable_goes_round_a_bake_of_one_sample_too(tmp_path, monkeypatch):
    named, path = [], write_shot(tmp_path, Recipe(strands=4))
    monkeypatch.setattr(picture.drawing, "_strip", lambda part, images, names: (named.extend(names), part.touch()))
    bake(path, tmp_path / "hair.usda", frames="3")
    picture.preview(tmp_path / "hair.usda", tmp_path / "hair.png", turntable=True, view=0, size=(32, 40))
    assert named == [f"frame 3, {angle}°" for angle in (0, 60, 120, 180, 240, 300)]


def test_a_turntable_goes_once_round_a_single_frame_and_shows_other_sides(hair, tmp_path):
    from PIL import Image

    path = picture.preview(hair, tmp_path / "hair.png", frames="6", turntable=True, size=(60, 80))
    pictures = np.asarray(Image.open(path).convert("RGB"), float)
    assert pictures.shape[1] == 6 * 64 - 4
    front, back = (pictures[:60, 64 * i : 64 * i + 60] for i in (0, 3))
    assert np.abs(front - back).max() > 30
    path = picture.preview(hair, tmp_path / "back.png", frames="6", view=32 + 180, size=(60, 80))
    np.testing.assert_array_equal(np.asarray(Image.open(path).convert("RGB"))[:60], back)


def test_frames_that_the_bake_lacks_and_sizes_that_nobody_draws_are_refused(hair, tmp_path):
    with pytest.raises(NeuralocksError, match="--frames 1:7: its frames are 5 to 12.5; choose from these"):
        picture.preview(hair, tmp_path / "hair.png", frames="1:7")
    with pytest.raises(NeuralocksError, match="--size 90000: must be a whole number from 16 to 4096"):
        picture.preview(hair, tmp_path / "hair.png", size=(64, 90000))
    for size in ((60,), 60, "60x60", (60, 60, 60)):
        with pytest.raises(NeuralocksError, match=r"--size .*: must be width and height in pixels"):
            picture.preview(hair, tmp_path / "hair.png", size=size)


def test_frames_that_the_bake_lacks_between_others_are_told(hair, tmp_path, monkeypatch):
    """A clip stood still there, and a strip showed other frames than those asked for."""
    monkeypatch.setattr(picture.drawing, "render", lambda scene, path, **_: path)
    layer, told = Sdf.Layer.OpenAsAnonymous(str(hair)), []
    layer.subLayerPaths[:] = [str(hair.with_name("shot.usda"))]
    for code in np.arange(7, 11, 0.5):
        layer.EraseTimeSample("/Hero/Hair.points", code)
    layer.Export(str(tmp_path / "part.usdc"))
    picture.preview(tmp_path / "part.usdc", "hair.png", frames="8:9", tell=told.extend)
    assert told == [
        "/Hero/Hair: has no samples between 6 and 11, where hair moves along straight lines; bake these frames, too"
    ]
    picture.preview(hair, "hair.png", frames="8:9", tell=told.extend)
    assert len(told) == 1


def test_a_clip_has_no_step(hair, tmp_path, monkeypatch):
    """It plays in real time; the step was dropped without a word."""
    monkeypatch.setattr(picture.drawing, "render", lambda scene, path, *, frames, **_: frames)
    for name in ("hair.gif", "hair.MP4"):
        with pytest.raises(NeuralocksError, match="--frames 6:12:3: a clip plays in real time; leave out STEP"):
            picture.preview(hair, tmp_path / name, frames="6:12:3")
        assert len(picture.preview(hair, tmp_path / name, frames="6:12:1")) == 7
    with pytest.raises(NeuralocksError, match="--view nan"):
        picture.preview(hair, tmp_path / "hair.png", view=float("nan"))


def test_the_commands_view_is_the_usual_one():
    assert inspect.signature(preview_command).parameters["view"].default == picture.AZIMUTH


def test_clothes_begin_at_the_shoulders_that_the_skeleton_has(hair):
    baked = read_baked(hair)
    character = baked.shot.grooms[0].attachment.character
    shoulder, neck = character.skeleton.bind[[character.humanoid["left_upper_arm"], character.humanoid["neck"]], :3, 3]
    low, high, aside = baked.scene().collar
    assert (low, high) == pytest.approx(sorted((shoulder[1], neck[1]))) and high - low > 0.05
    assert aside == pytest.approx(np.linalg.norm((shoulder - neck)[[0, 2]]), rel=0.05)


@pytest.mark.parametrize("hidden", [["Hair"], ["Hair", "Long"], []])
def test_hair_that_a_renderer_hides_is_not_drawn(tmp_path, hidden):
    """Such as a second hairstyle, or simulation guides; a bake of nothing else is drawn."""
    path = write_shot(tmp_path, Recipe(bound="mesh", strands=4))
    stage = Usd.Stage.Open(str(path))
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, "/Hero/Hair", layer, "/Hero/Long")
    if hidden:
        UsdGeom.Imageable(stage.GetPrimAtPath("/Hero/Hair")).CreateVisibilityAttr("invisible")
    if "Long" in hidden:
        UsdGeom.Imageable(stage.GetPrimAtPath("/Hero/Long")).CreatePurposeAttr("guide")
    stage.Save()
    bake(path, tmp_path / "hair.usda", frames="1:2")
    assert len(read_baked(tmp_path / "hair.usda").scene().counts) == (4 if hidden == ["Hair"] else 8)
