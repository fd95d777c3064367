# SPDX-License-Identifier: Apache-2.0
"""Rigged mesh hair in shots with something missing, held, ignored or out of reach: read as USD shows them, or told in a line."""

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

from neuralocks_core.errors import NeuralocksError
from usd.review.facts_text import as_text
from usd.review.inspect import inspect
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair
from usd.shot.notes.character_notes import weight_notes

from ..rig_shots import hair_turns, model_for, small_shot


@pytest.mark.parametrize(
    ("options", "words"), [({"bind": False}, "no bindTransforms"), ({"head_moves": False}, "is not animated")]
)
def test_bad_shots_are_told_in_one_line(tmp_path, options, words):
    """And nothing is written."""
    model = model_for(read_rigged_hair(small_shot(tmp_path / "good.usda")))
    shot = small_shot(tmp_path / "bad.usda", **options)
    with pytest.raises(NeuralocksError, match=words):
        bake_rig(shot, tmp_path / "out.usda", model)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bad.usda", "good.usda"]


def test_what_lacks_a_bind_pose_is_told_by_inspect_as_by_a_rig_bake(tmp_path):
    """Chains that no rig bake would move are not listed as if one did."""
    shot = small_shot(tmp_path / "bad.usda", bind=False)
    with pytest.raises(NeuralocksError) as refusal:
        read_rigged_hair(shot)
    facts = inspect(shot)
    assert f"note: {str(refusal.value).replace(': ', ': would stop a rig bake: ', 1)}" in as_text(facts)
    assert not facts["skeletons"][0]["hair chains"] and "rig bake move its hair chains" not in as_text(facts)


def test_a_character_that_is_hidden_by_its_scale_is_told_in_one_line(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    model, stage = model_for(read_rigged_hair(shot)), Usd.Stage.Open(str(shot))
    UsdGeom.Xformable(stage.GetPrimAtPath("/Who")).AddScaleOp().Set(Gf.Vec3f(0))
    stage.Save()
    for read in (lambda: bake_rig(shot, tmp_path / "out.usda", model), lambda: read_rigged_hair(shot)):
        with pytest.raises(
            NeuralocksError, match="^/Who/Rig: the transform of /Who above it has zero scale; give it a scale"
        ):
            read()
    assert not (tmp_path / "out.usda").exists()


@pytest.mark.parametrize("bound", [True, False], ids=["to a missing prim", "to nothing"])
def test_a_skeleton_without_an_animation_is_told_to_have_none(tmp_path, bound):
    """To name another joint with --head would not help."""
    shot = small_shot(tmp_path / "shot.usda")
    hair = read_rigged_hair(shot)
    model, stage = model_for(hair), Usd.Stage.Open(str(shot))
    animation = hair.stage_rig.joints.animation.GetPath()
    if bound:
        stage.RemovePrim(animation)
    else:
        stage.GetPrimAtPath(hair.path).RemoveProperty("skel:animationSource")
    stage.Save()
    with pytest.raises(NeuralocksError, match="the skeleton has no animation; bind a SkelAnimation to it"):
        bake_rig(shot, tmp_path / "out.usda", model)
    assert not (tmp_path / "out.usda").exists()


@pytest.mark.parametrize("first", [float("nan"), float("-inf"), 99.0])
def test_a_range_that_cannot_be_meant_gives_way_to_the_animations(tmp_path, first):
    shot = small_shot(tmp_path / "shot.usda")
    stage = Usd.Stage.Open(str(shot))
    model = model_for(read_rigged_hair(shot))
    stage.SetStartTimeCode(first)
    stage.SetEndTimeCode(24)
    stage.GetRootLayer().Save()
    out = bake_rig(shot=shot, out=tmp_path / "out.usda", model=model)
    assert out.rigs[0].samples == len(read_rigged_hair(shot).stage_rig.time_codes)


def test_a_held_head_is_that_of_a_held_pose(tmp_path):
    """Somebody who reads, or a still: the hair hangs from the bent head as it does in a shot that passes through the pose."""
    moving = small_shot(tmp_path / "moving.usda")
    model = model_for(read_rigged_hair(moving))
    stage = Usd.Stage.Open(str(small_shot(tmp_path / "held.usda")))
    rotations = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
    bent = rotations.Get(5)
    rotations.Clear()
    rotations.Set(bent, 1)
    stage.Save()
    bake_rig(moving, tmp_path / "moving_hair.usda", model)
    result = bake_rig(tmp_path / "held.usda", tmp_path / "held_hair.usda", model, frames="1:3")
    assert any("held pose" in note for note in result.notes)
    there = hair_turns(tmp_path / "moving_hair.usda", [5])
    assert np.abs(there[..., 1:]).max() > 0.01
    for code in (1, 3):
        assert np.abs(hair_turns(result.path, [code]) - there).max() < 1e-6


def test_joints_elsewhere_may_have_the_names_of_hair_joints(tmp_path):
    """A tail's joints are not hair's: rigs name every chain hair_0, joint1."""
    plain = small_shot(tmp_path / "plain.usda")
    model = model_for(read_rigged_hair(plain))
    text = small_shot(tmp_path / "tailed.usda").read_text()
    stage = Usd.Stage.Open(str(tmp_path / "tailed.usda"))
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig"))
    extra = ["hips/hair_0", "hips/hair_0/hair_1"]
    skeleton.GetJointsAttr().Set([*skeleton.GetJointsAttr().Get(), *extra])
    for attribute in (skeleton.GetBindTransformsAttr(), skeleton.GetRestTransformsAttr()):
        matrices = list(attribute.Get())
        attribute.Set(Vt.Matrix4dArray([*matrices, *[Gf.Matrix4d().SetTranslate((0, 0.9, -0.1))] * 2]))
    stage.Save()
    assert (tmp_path / "tailed.usda").read_text() != text
    for name in ("plain", "tailed"):
        bake_rig(tmp_path / f"{name}.usda", tmp_path / f"{name}_hair.usda", model)
    turns = [hair_turns(tmp_path / f"{name}_hair.usda", range(1, 26)) for name in ("plain", "tailed")]
    assert np.array_equal(*turns)


def test_a_body_that_nothing_animates_stays_where_it_rests(tmp_path):
    """If a parent moves the character, the bake's animation lists only hair joints: rest scales have more digits than an
    animation's.
    """
    shot = small_shot(tmp_path / "shot.usda")
    stage = Usd.Stage.Open(str(shot))
    skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig"))
    UsdSkel.BindingAPI(skeleton).GetAnimationSourceRel().ClearTargets(True)
    rest = list(skeleton.GetRestTransformsAttr().Get())
    rest[0] = Gf.Matrix4d().SetScale(0.01) * rest[0]
    rest[1] = rest[1] * Gf.Matrix4d().SetScale(100)
    skeleton.GetRestTransformsAttr().Set(Vt.Matrix4dArray(rest))
    turn = UsdGeom.Xformable(stage.GetPrimAtPath("/Who")).AddRotateXOp()
    for frame in range(1, 26):
        turn.Set(30 * float(np.sin(frame / 4)), frame)
    stage.Save()
    result = bake_rig(shot, tmp_path / "out.usda", model_for(read_rigged_hair(shot)))
    baked = Usd.Stage.Open(str(result.path))
    animation = UsdSkel.Animation(baked.GetPrimAtPath(result.rigs[0].animation))
    assert [name.rsplit("/", 1)[-1] for name in animation.GetJointsAttr().Get()] == ["hair_0", "hair_1", "hair_2"]


def test_hair_with_a_skeleton_of_its_own_is_told_what_it_needs(tmp_path):
    """The message is not that the body's skeleton, which comes first, has no hair; with the joint named, it is read."""
    stage = Usd.Stage.Open(str(small_shot(tmp_path / "shot.usda")))
    Sdf.CopySpec(stage.GetRootLayer(), "/Who/Rig", stage.GetRootLayer(), "/Who/Wig")
    body, wig = (UsdSkel.Skeleton(stage.GetPrimAtPath(f"/Who/{name}")) for name in ("Rig", "Wig"))
    for skeleton, old, new in ((body, "hair", "tie"), (wig, "head", "top")):
        skeleton.GetJointsAttr().Set([joint.replace(old, new) for joint in skeleton.GetJointsAttr().Get()])
    stage.GetPrimAtPath("/Who/Motion").GetAttribute("joints").Set(wig.GetJointsAttr().Get())
    UsdSkel.BindingAPI(stage.GetPrimAtPath("/Who/Hair")).GetSkeletonRel().SetTargets(["/Who/Wig"])
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match="^/Who/Wig: no joint is named like a head; name it with --head JOINT"):
        read_rigged_hair(tmp_path / "shot.usda")
    assert "note: /Who/Wig: no joint is named like a head" in as_text(inspect(tmp_path / "shot.usda"))
    assert len(read_rigged_hair(tmp_path / "shot.usda", head="top").rig.chains) == 3


def test_an_animation_that_usd_ignores_is_named_as_such(tmp_path):
    """With rotations alone, UsdSkel shows the rest pose: the message does not say that nobody animated the head."""
    model = model_for(read_rigged_hair(small_shot(tmp_path / "shot.usda")))
    stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    stage.GetPrimAtPath("/Who/Motion").RemoveProperty("scales")
    stage.GetRootLayer().Save()
    with pytest.raises(NeuralocksError, match="/Who/Motion: no scales, .*author all three channels"):
        bake_rig(tmp_path / "shot.usda", tmp_path / "out.usda", model)


def test_an_animation_that_is_switched_off_is_not_played(tmp_path):
    """USD shows the rest pose of a skeleton whose animation prim is inactive."""
    model = model_for(read_rigged_hair(small_shot(tmp_path / "shot.usda")))
    stage = Usd.Stage.Open(str(tmp_path / "shot.usda"))
    stage.GetPrimAtPath("/Who/Motion").SetActive(False)
    stage.GetRootLayer().Save()
    query = UsdSkel.Cache().GetSkelQuery(UsdSkel.Skeleton(stage.GetPrimAtPath("/Who/Rig")))
    assert not query.GetAnimQuery()
    with pytest.raises(NeuralocksError, match="/Who/Motion: is inactive, so UsdSkel ignores it; activate it"):
        bake_rig(tmp_path / "shot.usda", tmp_path / "out.usda", model)


def test_weights_that_do_not_sum_to_one_are_noted(tmp_path):
    """They are read as if they summed to one."""
    hair = read_rigged_hair(small_shot(tmp_path / "shot.usda", weights=0.5))
    assert "do not sum to one" in weight_notes(hair.stage_rig)[0]
    assert hair.rig.weights.sum(axis=1) == pytest.approx(1)


def test_vertices_without_weights_are_told_as_such(tmp_path):
    hair = read_rigged_hair(small_shot(tmp_path / "shot.usda", weights=0.0))
    (note,) = weight_notes(hair.stage_rig)
    assert "have no weights and are read as bound to the first joint" in note


def test_a_range_that_the_animation_does_not_reach_is_told(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot))
    assert any(
        "none of it within 5000 to 5003" in n
        for n in bake_rig(shot, tmp_path / "a.usda", model, frames="5000:5003").notes
    )
    assert not any("none of it" in note for note in bake_rig(shot, tmp_path / "b.usda", model).notes)
