# SPDX-License-Identifier: Apache-2.0
"""A rig bake over a rig bake: the body moves as the animation that was copied does, not as the copy."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdSkel

from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import BAKED, read_rigged_hair
from usd.skel.rig_copy import HAIR, SOURCE

from ..rig_shots import hair_turns, model_for, small_shot


@pytest.fixture
def folder(tmp_path):
    """A bake `hair.usda` of `shot.usda`, and `new.usda`, which goes over either and turns the head more."""
    shot = small_shot(tmp_path / "shot.usda")
    bake_rig(shot, tmp_path / "hair.usda", model_for(read_rigged_hair(shot)))
    new = Sdf.Layer.CreateNew(str(tmp_path / "new.usda"))
    for below in ("shot", "hair"):
        text = f"#usda 1.0\n(\n  metersPerUnit = 1\n  subLayers = [@./new.usda@, @./{below}.usda@]\n)\n"
        (tmp_path / f"on_{below}.usda").write_text(text)
    stage = Usd.Stage.Open(str(tmp_path / "on_shot.usda"))
    stage.SetEditTarget(new)
    rotations = stage.GetPrimAtPath("/Who/Motion").GetAttribute("rotations")
    before = {code: list(rotations.Get(code)) for code in rotations.GetTimeSamples()}
    for code, values in before.items():
        values[1] = values[1] * Gf.Quatf(Gf.Rotation(Gf.Vec3d(0, 1, 0), 40).GetQuat())
        rotations.Set(values, code)
    new.Save()
    return tmp_path


def _rotations(path, prim="/Who/Rig") -> list:
    stage = Usd.Stage.Open(str(path))
    attribute = stage.GetPrimAtPath(f"{prim}/{BAKED}").GetAttribute("rotations")
    return [list(attribute.Get(code)) for code in attribute.GetTimeSamples()]


def _pose(path, codes) -> np.ndarray:
    """Joint transforms (T, J, 4, 4) as UsdSkel shows them."""
    stage = Usd.Stage.Open(str(path))
    cache = UsdSkel.Cache()
    cache.Populate(UsdSkel.Root(stage.GetPrimAtPath("/Who")), Usd.PrimDefaultPredicate)
    query = cache.GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig")))
    return np.array([query.ComputeJointSkelTransforms(float(code)) for code in codes])


def test_an_updated_animation_reaches_a_bake_over_an_old_one(folder):
    model = model_for(read_rigged_hair(folder / "shot.usda"))
    notes = bake_rig(folder / "on_hair.usda", folder / "again.usda", model).notes
    assert not any("rig bake" in note for note in bake_rig(folder / "on_shot.usda", folder / "fresh.usda", model).notes)
    assert _rotations(folder / "again.usda") == _rotations(folder / "fresh.usda") != _rotations(folder / "hair.usda")
    assert any("rig bake of /Who/Motion, which has changed since; what that shows is read" in note for note in notes)
    notes = bake_rig(folder / "again.usda", folder / "third.usda", model).notes
    assert not any("changed since" in note for note in notes)
    assert _rotations(folder / "third.usda") == _rotations(folder / "again.usda")


def test_whoever_reads_the_copy_is_told_that_it_is_old(folder):
    """Renderers show the copy, and strands must fit what they show."""
    old = "/Who/Rig: its animation NeuralocksHair is a rig bake of /Who/Motion, which has changed since; bake the rig again"
    assert old in inspect(folder / "on_hair.usda")["spoils"]
    assert not any("changed since" in note for note in inspect(folder / "hair.usda")["spoils"])


def test_inspect_tells_hair_that_a_bake_moves_from_hair_that_it_could_move(folder):
    shot, baked = (inspect(folder / f"{name}.usda") for name in ("shot", "hair"))
    assert [each["skeletons"][0]["animation"] for each in (shot, baked)] == ["/Who/Motion", "/Who/Rig/NeuralocksHair"]
    assert [each["skeletons"][0]["moved by a rig bake"] for each in (shot, baked)] == [False, True]
    assert any("neuralocks rig train and rig bake move its hair chains" in note for note in shot["spoils"])
    assert any("a rig bake moves its hair chains" in note for note in baked["spoils"])


def test_a_copy_is_old_as_soon_as_two_degrees_differ(folder):
    stage = Usd.Stage.Open(str(folder / "shot.usda"))
    rotations = stage.GetPrimAtPath("/Who/Motion").GetAttribute("rotations")
    values = list(rotations.Get(9))
    values[1] = values[1] * Gf.Quatf(Gf.Rotation(Gf.Vec3d(0, 1, 0), 2).GetQuat())
    rotations.Set(values, 9)
    stage.Save()
    assert any(
        "rig bake of /Who/Motion, which has changed since" in note for note in inspect(folder / "hair.usda")["spoils"]
    )


def test_what_was_copied_is_found_through_references(folder):
    (folder / "set.usda").write_text(
        '#usda 1.0\n(\n  metersPerUnit = 1\n)\ndef "Hero" (references = @./on_hair.usda@</Who>)\n{\n}\n'
    )
    model = model_for(read_rigged_hair(folder / "shot.usda"))
    bake_rig(folder / "set.usda", folder / "again.usda", model)
    bake_rig(folder / "on_shot.usda", folder / "fresh.usda", model)
    assert _rotations(folder / "again.usda", "/Hero/Rig") == _rotations(folder / "fresh.usda")


def test_a_bake_of_other_hair_keeps_that_of_the_one_before(folder):
    model = model_for(read_rigged_hair(folder / "shot.usda", chains=["hair_1"]))
    bake_rig(folder / "on_hair.usda", folder / "both.usda", model)
    bake_rig(folder / "on_shot.usda", folder / "second.usda", model)
    codes = range(1, 26)
    first, second, both = (hair_turns(folder / f"{name}.usda", codes) for name in ("hair", "second", "both"))
    np.testing.assert_array_equal(both[:, 0], first[:, 0])
    np.testing.assert_array_equal(both[:, 1:], second[:, 1:])
    stage = Usd.Stage.Open(str(folder / "both.usda"))
    baked = stage.GetPrimAtPath(f"/Who/Rig/{BAKED}")
    assert [str(path) for path in baked.GetRelationship(SOURCE).GetTargets()] == ["/Who/Motion"]
    assert {name.rsplit("/", 1)[1] for name in baked.GetAttribute(HAIR).Get()} == {"hair_0", "hair_1", "hair_2"}


def test_hair_that_stays_keeps_samples_that_nothing_else_has(folder):
    """Those between frames, of a bake with subframes: hair would else go straight from frame to frame."""
    stage = Usd.Stage.Open(str(folder / "hair.usda"))
    rotations = stage.GetPrimAtPath(f"/Who/Rig/{BAKED}").GetAttribute("rotations")
    rotations.Set([Gf.Quatf(0.6, 0.8, 0, 0)] * 6, 7.5)
    stage.GetRootLayer().Save()
    other = model_for(read_rigged_hair(folder / "shot.usda", chains=["hair_1"]))
    bake_rig(folder / "hair.usda", folder / "both.usda", other)
    first, both = (hair_turns(folder / f"{name}.usda", [7, 7.5, 8])[:, 0] for name in ("hair", "both"))
    np.testing.assert_array_equal(both, first)


def test_hair_that_stays_as_the_animation_was_is_named_until_it_is_baked_again(folder):
    first, second = (model_for(read_rigged_hair(folder / "shot.usda", chains=[name])) for name in ("hair_0", "hair_1"))
    bake_rig(folder / "shot.usda", folder / "hair.usda", first)
    told = "/Who/Rig: 'hair_0' keeps the motion of an earlier animation"

    def notes_of(shot, out, model):
        return [note for note in bake_rig(folder / f"{shot}.usda", folder / f"{out}.usda", model).notes if told in note]

    def inspected(name):
        return [note for note in inspect(folder / f"{name}.usda")["spoils"] if told in note]

    assert not notes_of("hair", "both", second) and not inspected("both")
    assert len(notes_of("on_hair", "mixed", second)) == len(inspected("mixed")) == 1
    assert len(notes_of("mixed", "mixed_again", second)) == len(inspected("mixed_again")) == 1
    assert not notes_of("mixed", "fresh", first) and not inspected("fresh")


def test_a_copy_whose_source_is_gone_is_read_itself(folder):
    layer = Usd.Stage.Open(str(folder / "hair.usda")).Flatten()
    del layer.GetPrimAtPath("/Who").nameChildren["Motion"]
    layer.Export(str(folder / "alone.usda"))
    bake_rig(folder / "alone.usda", folder / "again.usda", model_for(read_rigged_hair(folder / "shot.usda")))
    assert _rotations(folder / "again.usda") == _rotations(folder / "hair.usda")


def test_a_bake_over_one_that_was_switched_off_moves(folder):
    stage = Usd.Stage.Open(str(folder / "hair.usda"))
    stage.GetPrimAtPath(f"/Who/Rig/{BAKED}").SetActive(False)
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Rig")).GetAnimationSourceRel().SetTargets(["/Who/Motion"])
    stage.Save()
    model = model_for(read_rigged_hair(folder / "shot.usda"))
    for below in ("hair", "shot"):
        bake_rig(folder / f"{below}.usda", folder / f"over_{below}.usda", model)
    codes = np.arange(1, 26)
    one, other = (_pose(folder / f"over_{below}.usda", codes) for below in ("hair", "shot"))
    np.testing.assert_array_equal(one, other)
    assert not np.array_equal(one[0], one[8])


@pytest.mark.parametrize("authored", [["blendShapes", "blendShapeWeights"], ["blendShapeWeights"]])
def test_the_face_of_an_earlier_bake_does_not_show_through(folder, authored):
    """The clip had a face when the hair was baked first, and has none, or no weights, now."""
    stage = Usd.Stage.Open(str(folder / "shot.usda"))
    motion = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion"))
    motion.CreateBlendShapesAttr(["smile"])
    motion.CreateBlendShapeWeightsAttr().Set([0.9], 3)
    stage.Save()
    model = model_for(read_rigged_hair(folder / "shot.usda"))
    bake_rig(folder / "shot.usda", folder / "hair.usda", model)
    for name in authored:
        motion.GetPrim().RemoveProperty(name)
    stage.Save()
    for below in ("hair", "shot"):
        bake_rig(folder / f"{below}.usda", folder / f"over_{below}.usda", model)
    shown = []
    for below in ("hair", "shot"):
        over = Usd.Stage.Open(str(folder / f"over_{below}.usda"))
        baked = UsdSkel.Animation(over.GetPrimAtPath(f"/Who/Rig/{BAKED}"))
        shown.append((baked.GetBlendShapesAttr().Get(), baked.GetBlendShapeWeightsAttr().Get(3)))
    assert shown[0] == shown[1] == ((None if len(authored) == 2 else ["smile"]), None)
