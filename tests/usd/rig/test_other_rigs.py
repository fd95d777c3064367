# SPDX-License-Identifier: Apache-2.0
"""A model on other rigs than the one that it was trained for: copies of it in other names, axes and sizes, and strangers."""

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdSkel

from neuralocks_core.errors import NeuralocksError
from neuralocks_core.rotation import from_vector
from usd.rig.bake import bake_rig
from usd.rig.stage import read_rigged_hair

from ..rig_shots import EXAMPLE, hair_turns, model_for, small_shot


def test_a_model_of_another_rig_is_named_as_such(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot))
    shot.write_text(shot.read_text().replace("hair_", "tuft"))
    with pytest.raises(NeuralocksError, match=r"1 hair chains \(hair_0, ...\).*a model trained for this rig"):
        bake_rig(shot, tmp_path / "out.usda", model)


def test_a_model_for_another_rig_is_refused(tmp_path):
    """By name, before anything is written."""
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(EXAMPLE / "character.usda"))
    with pytest.raises(NeuralocksError, match="rig train"):
        bake_rig(shot, tmp_path / "out.usda", model)


def test_the_likelier_cause_is_told_before_a_training(tmp_path):
    """Another head joint than in training, and a character that lies down, are no other rigs."""
    with pytest.raises(
        NeuralocksError, match="mm away.*in training the head was 'head', and here it is 'neck_01': check --head"
    ):
        bake_rig(EXAMPLE / "shot.usda", tmp_path / "out.usda", None, head="neck_01")
    stage = Usd.Stage.CreateNew(str(tmp_path / "lying.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    stage.DefinePrim("/Who").GetReferences().AddReference(str(EXAMPLE / "shot.usda"), "/Body")
    stage.Save()
    with pytest.raises(NeuralocksError, match="mm away.*but first: /Who/Rig: lies down"):
        bake_rig(tmp_path / "lying.usda", tmp_path / "out.usda", None, frames="1:2")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"head": 5}, "--head 5: must be a joint's name"),
        ({"joints": {"neck": 5}}, "--joint neck 5: must be a joint's name"),
        ({"joints": ["neck"]}, r"--joint \['neck'\]: must be a dict"),
    ],
)
def test_what_is_no_name_of_a_joint_is_refused(tmp_path, given, words):
    with pytest.raises(NeuralocksError, match=words):
        bake_rig(EXAMPLE / "shot.usda", tmp_path / "out.usda", None, **given)
    with pytest.raises(NeuralocksError, match="--chains 'Hair\\*': must be a list of names"):
        read_rigged_hair(EXAMPLE / "shot.usda", chains="Hair*")


@pytest.mark.parametrize("without", ["hidden", "inactive", "coarse"])
def test_the_hairs_mesh_need_not_be_there(tmp_path, without):
    """A model knows its joints: hidden hair, a stage with only animation, and a level of detail whose last joints move nothing are
    baked like the whole.
    """
    plain = small_shot(tmp_path / "plain.usda")
    model = model_for(read_rigged_hair(plain))
    stage = Usd.Stage.Open(str(small_shot(tmp_path / "shot.usda")))
    mesh = stage.GetPrimAtPath("/Who/Hair")
    if without == "hidden":
        UsdGeom.Imageable(mesh).MakeInvisible()
    elif without == "inactive":
        mesh.SetActive(False)
    else:
        UsdSkel.BindingAPI(mesh).GetJointIndicesPrimvar().Set([2] * 3 + [3] * 6)
    stage.Save()
    baked = [
        bake_rig(tmp_path / f"{name}.usda", tmp_path / f"{name}_out.usda", model).path for name in ("plain", "shot")
    ]
    np.testing.assert_array_equal(*(hair_turns(path, range(1, 26)) for path in baked))


def test_a_joint_that_hangs_from_another_one_is_not_the_models(tmp_path):
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot))
    shot.write_text(shot.read_text().replace("hair_0/hair_1/hair_2", "hair_0/hair_2"))
    with pytest.raises(NeuralocksError, match="joint 'hair_2' hangs from another joint here"):
        bake_rig(shot, tmp_path / "out.usda", model)


@pytest.mark.parametrize("off", [3e-8, -2e-5])
def test_a_frame_beside_a_sample_by_rounding_is_that_sample(tmp_path, off):
    """Otherwise there would be two samples whose times no program can tell apart."""
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot))
    stage = Usd.Stage.Open(str(shot))
    rotations = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
    values = {code + off: rotations.Get(code) for code in rotations.GetTimeSamples()}
    rotations.Clear()
    for code, value in values.items():
        rotations.Set(value, code)
    stage.Save()
    assert bake_rig(shot, tmp_path / "out.usda", model).rigs[0].samples == len(values)


def test_what_the_body_is_at_no_time_stays(tmp_path):
    """A viewer that asks for no time shows the values at the default time, which exist besides samples."""
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot))
    stage = Usd.Stage.Open(str(shot))
    rotations = UsdSkel.Animation(stage.GetPrimAtPath("/Who/Motion")).GetRotationsAttr()
    rotations.Set([Gf.Quatf(0.8, 0, 0.6, 0)] * 6)
    stage.Save()
    baked = Usd.Stage.Open(str(bake_rig(shot, tmp_path / "out.usda", model).path))
    found = UsdSkel.Animation(baked.GetPrimAtPath("/Who/Rig/NeuralocksHair")).GetRotationsAttr()
    assert list(found.Get()) == list(rotations.Get()) and found.GetTimeSamples() == rotations.GetTimeSamples()


@pytest.mark.parametrize("prefix", ["Anna_hair_", "tuft_"])
def test_joints_that_only_begin_otherwise_are_the_models(tmp_path, prefix):
    """Exporters put namespaces before names; bones elsewhere than the model's are refused all the same."""
    shot = small_shot(tmp_path / "shot.usda")
    model = model_for(read_rigged_hair(shot))
    plain = bake_rig(shot, tmp_path / "plain.usda", model)
    text = shot.read_text()
    shot.write_text(text.replace("hair_", prefix))
    result = bake_rig(shot, tmp_path / "out.usda", model)
    codes = range(1, 26)
    np.testing.assert_array_equal(hair_turns(result.path, codes), hair_turns(plain.path, codes))
    assert any(f"'{prefix}0' for 'hair_0'" in note for note in result.notes)
    small_shot(tmp_path / "long.usda", step=0.09)
    (other := tmp_path / "long_named.usda").write_text((tmp_path / "long.usda").read_text().replace("hair_", prefix))
    with pytest.raises(NeuralocksError, match="away from its place in the rig"):
        bake_rig(other, tmp_path / "long_out.usda", model)


def test_joint_orients_cancel(tmp_path):
    """A rig that went through another exporter has other axes; the original rig's model moves its hair the same in space."""
    plain = small_shot(tmp_path / "plain.usda")
    orient = from_vector(np.array([1.2, -0.4, 2.0]))
    other = small_shot(tmp_path / "other.usda", orient=orient)
    model = model_for(read_rigged_hair(plain))
    since = []
    for shot in (plain, other):
        bake_rig(shot, tmp_path / f"out_{shot.name}", model)
        source = read_rigged_hair(tmp_path / f"out_{shot.name}").stage_rig.joints
        posed = source.posed([1, 7, 13, 20])[:, 2:5, :3, :3]
        since.append(posed @ np.swapaxes(source.bind[2:5, :3, :3], -1, -2))
    assert np.abs(since[0] - since[1]).max() < 1e-5 and np.abs(since[0] - np.eye(3)).max() > 0.1


@pytest.mark.parametrize("first", [0, 1], ids=["all", "head and hair"])
def test_mirrored_joints_move_alike(tmp_path, first):
    """Axes of negative scale, which some rigs have from the root or the head on, only concern the file."""
    orient = from_vector(np.array([1.2, -0.4, 2.0]))
    plain = small_shot(tmp_path / "plain.usda", orient=orient)
    model, places = model_for(read_rigged_hair(plain)), []
    for shot in (plain, small_shot(tmp_path / "mirrored.usda", orient=orient, mirrored=first)):
        bake_rig(shot, tmp_path / f"out_{shot.name}", model)
        both = (read_rigged_hair(path).stage_rig.joints for path in (shot, tmp_path / f"out_{shot.name}"))
        places.append([source.posed([1, 7, 13, 20])[:, :, :3, 3] for source in both])
    (still, moved), (mirrored_still, mirrored_moved) = places
    assert np.abs(moved - mirrored_moved).max() < 1e-6 and np.abs(moved - still).max() > 0.01
    assert np.abs(still - mirrored_still)[:, :2].max() < 1e-6


@pytest.mark.parametrize(
    ("size", "told"), [(1.015, None), (1.03, "1.03 times as large"), (0.75, "0.75 times as large")]
)
def test_a_character_of_another_size_moves_its_hair_alike(tmp_path, size, told):
    """Turns do not depend on size."""
    plain = small_shot(tmp_path / "plain.usda")
    model = model_for(read_rigged_hair(plain), dynamic=True)
    bake_rig(plain, tmp_path / "plain_out.usda", model)
    result = bake_rig(_sized(tmp_path, size), tmp_path / "out.usda", model)
    codes = range(1, 26)
    assert np.abs(hair_turns(result.path, codes) - hair_turns(tmp_path / "plain_out.usda", codes)).max() < 1e-5
    notes = [note for note in result.notes if "as large" in note]
    assert len(notes) == bool(told) and all(told in note for note in notes)


@pytest.mark.parametrize(("size", "told"), [(100, "100 times"), (0.01, "0.01 times"), (1.5, "1.5 times")])
def test_another_unit_is_told_as_such(tmp_path, size, told):
    model = model_for(read_rigged_hair(small_shot(tmp_path / "plain.usda")))
    with pytest.raises(NeuralocksError, match=f"{told} as large as the one .* check metersPerUnit"):
        bake_rig(_sized(tmp_path, size), tmp_path / "out.usda", model)


def _sized(folder, size):
    """The small shot in a stage whose unit makes it `size` times as large."""
    shot = small_shot(folder / "sized.usda", scale=100.0)
    stage = Usd.Stage.Open(str(shot))
    UsdGeom.SetStageMetersPerUnit(stage, 0.01 * size)
    stage.GetRootLayer().Save()
    return shot
