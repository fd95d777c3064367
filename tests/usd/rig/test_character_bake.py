# SPDX-License-Identifier: Apache-2.0
"""What a rig bake tells of a character that is not quite the one that its model was trained for, or that holds still."""

from dataclasses import replace

import numpy as np
import pytest
from pxr import Gf, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair
from usd.skel.clip_codes import SAME

from ..rig_shots import hair_turns, model_for, small_shot

CODES = [1, 7, 20]


@pytest.fixture
def model(tmp_path):
    """A model for the plain small shot."""
    return model_for(read_rigged_hair(small_shot(tmp_path / "trained.usda")))


def _renamed(change):
    """A change of the stage: other names for all six joints."""

    def rename(stage):
        for path in ("/Who/Rig", "/Who/Motion"):
            joints = stage.GetPrimAtPath(path).GetAttribute("joints")
            joints.Set([change(name) for name in joints.Get()])

    return rename


def test_joints_with_a_rigs_name_before_theirs_move_alike_and_are_told(edited, tmp_path, model):
    shot = edited(_renamed(lambda path: "/".join(f"Ann_{name}" for name in path.split("/"))))
    result = bake_rig(shot, tmp_path / "out.usda", model)
    assert "model: its joints have other names here, 'Ann_hair_0' for 'hair_0'" in result.notes
    plain = bake_rig(tmp_path / "trained.usda", tmp_path / "plain.usda", model)
    assert not any("model" in note for note in plain.notes)
    np.testing.assert_array_equal(hair_turns(result.path, CODES), hair_turns(plain.path, CODES))


def test_a_character_of_another_size_is_told(edited, tmp_path, model):
    shot = edited(lambda stage: UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/Who")).SetScale((1.2, 1.2, 1.2)))
    (told,) = [note for note in bake_rig(shot, tmp_path / "out.usda", model).notes if "trained for" in note]
    assert told.startswith("/Who/Rig: is 1.20 times as large as the character that the model was trained for;")


def _turned(stage, moves):
    """Turn the head by 30 degrees, and on if it moves."""
    rotations = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
    for code in rotations.GetTimeSamples():
        values = list(rotations.Get(code))
        values[1] = Gf.Quatf(Gf.Rotation(Gf.Vec3d(1, 0, 0), 30 + moves * code).GetQuat())
        rotations.Set(values, code)


@pytest.mark.parametrize("moves", [False, True])
def test_a_head_that_holds_a_turned_pose_is_told(edited, tmp_path, model, moves):
    """Hair hangs from it as the pose has it, but one may have named another joint."""
    result = bake_rig(edited(lambda stage: _turned(stage, moves)), tmp_path / "out.usda", model)
    told = "/Who/Rig: its head joint 'head' does not move, so the hair is that of a held pose"
    assert (told in result.notes) != moves
    assert np.abs(hair_turns(result.path, CODES)[..., 1:]).max() > 0.01


def test_nothing_is_baked_where_neither_head_nor_hair_moves(edited, tmp_path, model):
    still = replace(model, layers=tuple((0 * weight, 0 * bias) for weight, bias in model.layers))
    with pytest.raises(NeuralocksError, match="/Who/Rig: its head joint 'head' is not animated, so the hair would not"):
        bake_rig(edited(lambda stage: _turned(stage, 0)), tmp_path / "out.usda", still)
    assert bake_rig(edited(lambda stage: _turned(stage, 1)), tmp_path / "out.usda", still).rigs


@pytest.mark.parametrize("loop", [False, True])
def test_motion_that_does_not_end_as_it_begins_is_told_of_loops_alone(edited, tmp_path, model, loop):
    notes = bake_rig(edited(lambda stage: _turned(stage, 1)), tmp_path / "out.usda", model, loop=loop).notes
    told = (
        "/Who/Rig: joint 'hips/head' is turned by 24 degrees between time codes 1 and 25; a loop must end with the pose"
    )
    assert any(note.startswith(told) for note in notes) == any("loop" in note for note in notes) == loop


@pytest.mark.parametrize(("last", "told"), [("hair_3", False), ("hips", True)])
def test_joints_that_blender_would_rename_are_told(edited, tmp_path, model, last, told):
    shot = edited(_renamed(lambda path: path.replace("hair_3", last)))
    said = "/Who/Rig: several joints are named 'hips'; Blender renames all but one"
    assert (said in bake_rig(shot, tmp_path / "out.usda", model).notes) == told


def test_where_a_model_does_not_fit_another_head_than_in_training_is_told(edited, tmp_path, model):
    shot = edited(_renamed(lambda path: path.replace("hair_3", "kopf")), step=0.11)
    for trained, told in (("kopf", True), ("head", False), ("gone", False), (None, False), ([], False)):
        other = replace(model, training={"reads": {"head": trained}})
        with pytest.raises(NeuralocksError) as caught:
            bake_rig(shot, tmp_path / "out.usda", other)
        _, but, said = str(caught.value).partition("; but ")
        assert bool(but) == told, caught.value
        assert not told or said == "in training the head was 'kopf', and here it is 'head': check --head first"


@pytest.mark.parametrize(("trained", "told"), [("hair_3", True), ("gone", False), ("head", False)])
def test_only_a_joint_that_is_here_may_be_meant_in_place_of_the_one_read(tmp_path, model, trained, told):
    other = replace(model, training={"reads": {"neck": trained}})
    notes = bake_rig(tmp_path / "trained.usda", tmp_path / "out.usda", other).notes
    said = "/Who/Rig: 'head' is read as neck, but in training 'hair_3' was, which is here, too"
    assert any(note.startswith(said) for note in notes) == told == any("is read as" in note for note in notes)


@pytest.mark.parametrize("off", [-0.4, 0.0, 0.4])
def test_a_frame_and_a_sample_that_rounding_parts_are_one(edited, tmp_path, model, off):
    """Whichever comes first; a frame between two samples is one more."""

    def shift(stage):
        rotations = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
        values = {code: rotations.Get(code) for code in rotations.GetTimeSamples()}
        rotations.Clear()
        for code, value in values.items():
            rotations.Set(value, code + off * SAME)

    shot = edited(shift)
    assert bake_rig(shot, tmp_path / "out.usda", model, frames="1:25").rigs[0].samples == 25
    assert bake_rig(shot, tmp_path / "more.usda", model, frames="1.5:25").rigs[0].samples == 25 + 24
