# SPDX-License-Identifier: Apache-2.0
"""What `neuralocks train` begins with, decided before anything large is read."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.boundary.spec import BoundarySpec
from neuralocks_core.errors import NeuralocksError
from neuralocks_core.models import model_file

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")
from neuralocks_core.training.data.rollouts import TrainingScene
from neuralocks_core.training.learning.moment_options import SelfSupervisedOptions
from neuralocks_core.training.learning.regression_options import RegressionOptions
from usd.assets.grow import grow
from usd.cli.train import one_by_one
from usd.models.clip_file import read_clip
from usd.models.train import begins_with, train
from usd.models.training_scene import MOST_STRANDS, training_scene
from usd.shot.stage import read_rigs

from ...core.animation.written_bvh import write_bvh
from ..shots import HAIR, PARENTS, Recipe, write_shot

BODY = Path(__file__).parents[3] / "examples/shot/body.usdc"
SPEC, OTHER = BoundarySpec(), BoundarySpec(bins=(1,) * 30)
LIKE, STILL, PAPER = RegressionOptions(), RegressionOptions(static=True), SelfSupervisedOptions.paper()


def test_left_out_it_is_the_shipped_model_where_that_fits():
    assert begins_with(None, False, SPEC, LIKE) == model_file.shipped()
    for spec, options in ((OTHER, LIKE), (SPEC, STILL), (SPEC, PAPER)):
        assert begins_with(None, False, spec, options) is None
    assert begins_with(None, True, SPEC, LIKE) is None, "a resumed training has its own beginning"


def test_what_is_named_is_taken_or_refused(tmp_path):
    assert begins_with("shipped", False, SPEC, LIKE) == model_file.shipped()
    assert begins_with("nothing", False, SPEC, LIKE) is None
    with pytest.raises(NeuralocksError, match="strands.neuralocks: differs from this training in static"):
        begins_with("shipped", False, SPEC, STILL)
    with pytest.raises(NeuralocksError, match="differs from this training in static; resume with the settings"):
        begins_with("shipped", True, SPEC, STILL)
    with pytest.raises(
        NeuralocksError, match="none.neuralocks: no such model file; name another, 'shipped' or 'nothing'"
    ):
        begins_with(tmp_path / "none.neuralocks", False, SPEC, LIKE)


@pytest.mark.parametrize(
    ("words", "fact"),
    [
        ({"grooms": ["bob", "bop"]}, "^bop: is neither a file nor a style; .* use one of library, .*bob"),
        ({"grooms": ["bob"], "motion": ["walk.bvh"]}, "^walk.bvh: no such file"),
    ],
)
def test_every_word_is_looked_at_before_a_style_grows(words, fact, tmp_path):
    with pytest.raises(NeuralocksError, match=fact):
        training_scene(BODY, **words, progress=lambda *_: pytest.fail("grows"))
    with pytest.raises(NeuralocksError, match=fact):
        train(BODY, words["grooms"], words.get("motion", []), tmp_path / "own.neuralocks", {})


@pytest.mark.parametrize(
    "grooms, begin, taken",
    [
        (["coils"], "shipped", "strands_coily"),
        (["coils", "bob"], None, "strands"),
        (["coils"], str(model_file.shipped()), "strands"),
    ],
)
def test_of_the_shipped_models_it_is_the_one_that_knows_such_hair(grooms, begin, taken, tmp_path, monkeypatch):
    """What it knows it need not learn again. A file that is named is taken as it is."""
    begun, told = [], []

    def begins(scene, out, options, begin, **_):
        begun.append(begin.stem)
        return model_file.shipped()

    monkeypatch.setattr("neuralocks_core.training.train.train_strands", begins)
    monkeypatch.setattr("usd.models.training_scene.MOST_STRANDS", 40)
    train(BODY, grooms, [], tmp_path / "own.neuralocks", {}, begin=begin, tell=told.extend)
    assert begun == [taken]
    assert any("coily hair" in note for note in told) == (taken == "strands_coily")


def test_what_a_training_should_know_is_told_before_it(tmp_path):
    """Of several skeletons, the first is taken; motion is taken from the one with the character's joints."""
    path = write_shot(tmp_path, Recipe(bound="mesh", strands=MOST_STRANDS + 40, vertices=3))
    stage = Usd.Stage.Open(str(path))
    layer = stage.GetRootLayer()
    Sdf.CopySpec(layer, "/Hero/Rig", layer, "/Hero/Another")
    layer.Save()
    told, grown = [], []
    scene = training_scene(path, motion=[str(path)], tell=told.extend)
    grow("bob", path, tmp_path / "bob.usda", 20, tell=grown.extend)
    for notes in (told, grown):
        assert any("/Hero/Rig: the first of 2 skeletons is taken" in note for note in notes)
    assert any("no joint found for" in note for note in told)
    short = f"{path}: moves for less than 2.2 s at a time, too short to learn from; give longer motion"
    assert short in told and not scene.usable(scene.clips[0])
    assert len(scene.grooms[0].rest) == MOST_STRANDS and len(scene.clips) == 1
    alone = training_scene(path, str(path), str(path))
    assert len(alone.grooms) == 1 and len(alone.clips) == 1, "a name is one file, not one of each letter"
    stage.GetPrimAtPath("/Hero/Rig").GetRelationship("skel:animationSource").SetTargets([])
    layer.Save()
    assert len(read_clip(str(path), scene.character).times) > 1


def test_of_a_shot_of_several_characters_only_the_own_hair_is_learned(tmp_path):
    """As a bake with --skeleton has it; all at once they would be hair that floats beside the head."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    layer = Sdf.Layer.FindOrOpen(str(path))
    apart = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    for name, x in (("Anna", -1.0), ("Bert", 1.0)):
        prim = apart.DefinePrim(f"/{name}")
        prim.GetReferences().AddReference(layer.identifier, "/Hero")
        UsdGeom.XformCommonAPI(prim).SetTranslate((x, 0, 0))
    UsdSkel.BindingAPI(apart.GetPrimAtPath("/Bert/Hair")).CreateSkeletonRel().SetTargets(["/Bert/Rig"])
    Sdf.CopySpec(layer, HAIR, apart.GetRootLayer(), "/Anna/Bun")
    apart.Save()
    told = []
    assert len(training_scene(apart.GetRootLayer().realPath, tell=told.extend).grooms) == 2
    assert [note for note in told if "/Bert/Hair: is hair of /Bert/Rig, not of /Anna/Rig; left out" in note]
    told.clear()
    assert len(training_scene(apart.GetRootLayer().realPath, skeleton="/Bert/Rig", tell=told.extend).grooms) == 1
    assert sum("is hair of /Anna/Rig, not of /Bert/Rig; left out" in note for note in told) == 2
    for hair in ("/Anna/Hair", "/Anna/Bun"):
        apart.RemovePrim(hair)
    apart.OverridePrim("/Anna/Hair").SetActive(False)
    apart.Save()
    with pytest.raises(
        NeuralocksError, match="/Bert/Hair: is hair of /Bert/Rig, not of /Anna/Rig; choose its character"
    ):
        training_scene(apart.GetRootLayer().realPath)


def test_motion_of_a_character_whose_head_has_another_name_needs_no_second_word(tmp_path):
    """The character's head is named with --head; the motion has the same joints."""
    path = write_shot(tmp_path, Recipe(bound="mesh"))
    layer = Sdf.Layer.FindOrOpen(str(path))
    for prim in ("/Hero/Rig", "/Hero/Rig/Motion"):
        joints = layer.GetAttributeAtPath(f"{prim}.joints")
        joints.default = [name.replace("neck/head", "b6/b7").replace("neck", "b6") for name in joints.default]
    layer.Save()
    character = read_rigs(path, head="b7")[0].character
    del layer.GetPrimAtPath("/Hero").nameChildren["Hair"]
    layer.Export(str(tmp_path / "clip.usda"))
    clip = read_clip(str(tmp_path / "clip.usda"), character)
    assert len(clip.times) > 1
    binds = layer.GetAttributeAtPath("/Hero/Rig.bindTransforms")
    moved = np.array(binds.default)
    moved[6:, 3, 0] *= 1.5  # longer arms, so that the motion is put on ours
    binds.default, notes = Vt.Matrix4dArray.FromNumpy(moved), []
    layer.Export(str(tmp_path / "elsewhere.usda"))
    elsewhere = read_clip(str(tmp_path / "elsewhere.usda"), character, notes)
    assert len(elsewhere.times) == len(clip.times) and "so the motion is retargeted" in notes[0]
    layer.GetAttributeAtPath("/Hero/Rig.joints").default = [f"other{n}" for n in range(8)]
    layer.Export(str(tmp_path / "other.usda"))
    with pytest.raises(NeuralocksError, match="other.usda: its skeleton is not the character's"):
        read_clip(str(tmp_path / "other.usda"), character)


@pytest.mark.parametrize("character", [Recipe(bound="mesh"), Recipe(bound="mesh", unit=0.01, up="Z")])
@pytest.mark.parametrize("groom", [{}, {"unit": 0.01}, {"up": "Z"}, {"unit": 0.01, "up": "Z"}])
@pytest.mark.parametrize(("bound", "rigged"), [("none", False), ("own", False), ("own", True)])
def test_a_groom_in_a_file_of_its_own_has_that_files_unit_and_axis(tmp_path, character, groom, bound, rigged):
    """Or the character's, as far as its file does not tell."""
    path, groom, told = write_shot(tmp_path, character), Recipe(bound=bound, **groom), []
    hair = Sdf.Layer.FindOrOpen(str(write_shot(tmp_path, groom, "groom")))
    for name in {*hair.GetPrimAtPath("/Hero").nameChildren.keys()} - ({"Hair", "Rig"} if rigged else {"Hair"}):
        del hair.GetPrimAtPath("/Hero").nameChildren[name]
    hair.Export(str(tmp_path / "alone.usda"))
    wanted = training_scene(path).grooms[0]
    found = training_scene(path, [str(tmp_path / "alone.usda")], tell=told.extend).grooms[0]
    np.testing.assert_allclose(found.rest, wanted.rest, atol=2e-6)
    assert not any("lies" in note for note in told)
    if (groom.unit, groom.up) == (character.unit, character.up):
        for name in ("metersPerUnit", "upAxis"):
            hair.pseudoRoot.ClearInfo(name)
        hair.Export(str(tmp_path / "untold.usda"))
        again = training_scene(path, [str(tmp_path / "untold.usda")]).grooms[0]
        np.testing.assert_array_equal(again.rest, found.rest)


def test_a_groom_that_is_not_on_the_head_and_empty_curves_are_told(tmp_path):
    path, told = write_shot(tmp_path, Recipe(bound="mesh")), []
    stage = Usd.Stage.CreateNew(str(tmp_path / "away.usda"))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    curves = UsdGeom.BasisCurves.Define(stage, "/Hair")
    curves.CreatePointsAttr([(x, 9.0, 0.1 * i) for x in range(6) for i in range(4)])
    curves.CreateCurveVertexCountsAttr([4] * 6)
    UsdGeom.BasisCurves.Define(stage, "/Empty").CreatePointsAttr([])
    stage.Save()
    training_scene(path, [str(tmp_path / "away.usda")], tell=told.extend)
    assert [note for note in told if note.startswith("/Hair: lies ") and "check the file's metersPerUnit" in note]


@pytest.mark.parametrize("told", [Recipe(bound="mesh", unit=0.01, up="Z"), Recipe(bound="mesh", unit=1.0)])
@pytest.mark.parametrize("untold", ["as the character's", "as USD has it"])
def test_motion_that_tells_no_unit_and_axis_is_read_as_its_bind_pose_says(tmp_path, told, untold):
    """A file may leave out what is the character's, or what is USD's own: centimetres, Y up."""
    path = write_shot(tmp_path, told)
    (rig,) = read_rigs(path)
    other = path if "character" in untold else write_shot(tmp_path, Recipe(bound="mesh", unit=0.01), "other")
    layer = Sdf.Layer.FindOrOpen(str(other))
    for name in ("metersPerUnit", "upAxis"):
        layer.pseudoRoot.ClearInfo(name)
    layer.Export(str(tmp_path / "untold.usda"))
    clip = read_clip(str(tmp_path / "untold.usda"), rig.character, beside=rig.border)
    np.testing.assert_allclose(clip.joints, rig.clip.joints, atol=1e-6)


def test_no_training_flies_across_the_cuts_of_a_capture(tmp_path):
    """A T-pose at the origin leads in, and two takes are joined: rollouts that held such a jump flung hair at 100 m/s."""
    character = read_rigs(write_shot(tmp_path, Recipe(bound="mesh")))[0].character
    places = [(0, 95, 0), *[(300 + 3 * i, 95, 0) for i in range(150)], *[(-80, 95, 200 + 3 * i) for i in range(150)]]
    clip = read_clip(str(write_bvh(tmp_path / "take.bvh", [{}] * 301, places=places)), character)
    np.testing.assert_allclose(clip.cuts, clip.times[[1, 151]])
    parts = TrainingScene(character, (), (clip,)).usable(clip)
    assert [len(part.times) for part in parts] == [150, 150]
    fastest = max(
        np.linalg.norm(np.diff(part.joints[:, character.head, :3, 3], axis=0), axis=1).max() for part in parts
    )
    assert fastest < 0.1


def test_what_cannot_be_written_is_told_before_training(tmp_path):
    (tmp_path / "folder.neuralocks").mkdir()
    with pytest.raises(NeuralocksError, match="folder.neuralocks: is a folder; give a file name"):
        train(tmp_path / "nobody.usda", [], [], tmp_path / "folder.neuralocks", {})


def test_a_second_moving_skeleton_is_told(tmp_path):
    path, notes = write_shot(tmp_path, Recipe(bound="mesh")), []
    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    for name in ("Anna", "Bert"):
        stage.DefinePrim(f"/{name}").GetReferences().AddReference(str(path), "/Hero")
    stage.Save()
    read_clip(str(tmp_path / "two.usda"), read_rigs(path)[0].character, notes)
    (told,) = [note for note in notes if "learned from" in note]
    assert told.startswith(
        "two.usda: /Anna/Rig is learned from, and not the other 1 that move in it, such as /Bert/Rig"
    )


@pytest.mark.parametrize("change", ["turned", "halved"])
def test_motion_of_the_same_joints_in_other_axes_or_places_moves_the_character_alike(tmp_path, change):
    """Two exporters give one rig other joint axes; another person's rig may have the same names."""
    path, notes = write_shot(tmp_path, Recipe(bound="mesh")), []
    character = read_rigs(path)[0].character
    stage = Usd.Stage.Open(str(path))
    wanted = read_clip(str(path), character)
    if change == "halved":
        UsdGeom.Xformable(stage.GetPrimAtPath("/Hero")).AddScaleOp().Set((0.5, 0.5, 0.5))
    else:
        turn = np.eye(4)
        turn[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
        skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Hero/Rig"))
        binds = np.array(skeleton.GetBindTransformsAttr().Get())
        skeleton.GetBindTransformsAttr().Set(Vt.Matrix4dArray.FromNumpy(turn @ binds))
        motion = UsdSkel.Animation(stage.GetPrimAtPath("/Hero/Rig/Motion"))
        for code in motion.GetRotationsAttr().GetTimeSamples():
            local = np.array(UsdSkel.MakeTransforms(*(a.Get(code) for a in _channels(motion))))
            roots = np.array([parent < 0 for parent in PARENTS])
            turned = np.where(roots[:, None, None], turn @ local, turn @ local @ turn.T)
            parts = UsdSkel.DecomposeTransforms(Vt.Matrix4dArray.FromNumpy(turned))
            for attribute, values in zip(_channels(motion), parts, strict=True):
                attribute.Set(values, code)
    stage.Save()
    clip = read_clip(str(path), character, notes)
    turns = [character.relative_rotations(each.joints, np.arange(4)) for each in (wanted, clip)]
    np.testing.assert_allclose(turns[1], turns[0], atol=1e-4 if change == "turned" else 2e-2)
    ratio = [np.ptp(each.joints[:, 3, :3, 3], axis=0) for each in (wanted, clip)]
    np.testing.assert_allclose(ratio[1], ratio[0], atol=1e-4 if change == "turned" else 2e-2)
    told = [note for note in notes if "bind pose is not" in note]
    assert len(told) == (change == "halved")
    if told:
        away = 0.5 * np.linalg.norm(character.skeleton.bind[:, :3, 3], axis=1)
        furthest = character.skeleton.names[away.argmax()].split("/")[-1]
        assert f"('{furthest}' is {away.max():.2g} m elsewhere)" in told[0] and told[0].endswith("as a BVH's is")


def _channels(motion: UsdSkel.Animation) -> list[Usd.Attribute]:
    return [motion.GetTranslationsAttr(), motion.GetRotationsAttr(), motion.GetScalesAttr()]


def test_options_take_as_many_words_as_follow():
    """As the shell's own `--motion clips/*.bvh` gives them."""
    words = one_by_one(
        "train --groom a.usd b.usd --motion c.bvh -o m --groom d.usd e.usd --set a=1 b=2 --resume".split()
    )
    assert words == (
        "train --groom a.usd --groom b.usd --motion c.bvh -o m --groom d.usd --groom e.usd --set a=1 --set b=2 --resume".split()
    )
